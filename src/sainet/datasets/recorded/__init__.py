"""Recorded pushes of real robots, read into stores like any other."""
