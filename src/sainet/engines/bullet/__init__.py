"""Bullet, the paper's engine, on the host: one world per process (extra `bullet`).

`world` simulates one push with PyBullet, `pool` distributes pushes over processes, and
`engine` implements the interface of all engines.
"""
