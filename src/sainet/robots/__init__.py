"""Robots, which observe disks and execute pushes."""
