"""Connections to a physical robot: ABB's Externally Guided Motion and its limits."""
