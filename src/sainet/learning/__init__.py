"""Fitting a network to stored pushes: loss, statistics, optimiser and the loop."""
