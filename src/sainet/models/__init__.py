"""Dynamics models: physics, the interaction network and its augmented form."""
