"""Closed-loop episodes, and trials of many of them."""
