"""Figures: arrays in, SVG or PNG files out."""
