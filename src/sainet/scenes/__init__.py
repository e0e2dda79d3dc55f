"""Scenes, states, shapes, pushes and controls."""
