"""The simulated world: what executes pushes, with noise."""
