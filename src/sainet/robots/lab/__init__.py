"""The virtual lab: a table, disks, a robot and motion capture, simulated by MuJoCo.

Its results are virtual-lab results, never real ones.
"""
