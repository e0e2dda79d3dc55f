"""Bullet, the paper's engine, on the host: one world for each process (extra `bullet`).

`world` turns one push into PyBullet calls, `pool` spreads pushes over processes, and
`engine` gives both the interface of every other engine.
"""
