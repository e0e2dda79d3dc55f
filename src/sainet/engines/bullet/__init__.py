"""Bullet, the paper's engine, on the host: one world per process (extra `bullet`).

`world` simulates one push with PyBullet; `engine` implements the interface of all
engines and distributes pushes over processes.
"""
