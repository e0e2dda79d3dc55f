"""Fitting an engine's own parameters to pushes that were observed."""
