"""Stored pushes, simulated or recorded: how they are made, kept and read."""
