"""Estimation of engine parameters and the camera offset from observed pushes."""
