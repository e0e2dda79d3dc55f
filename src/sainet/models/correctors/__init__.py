"""Correctors: they predict motion, with or without a simulator prediction."""
