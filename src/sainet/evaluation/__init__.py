"""Errors of predictions with their intervals, and success of control trials."""
