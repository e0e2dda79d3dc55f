"""A scene of two touching disks, and goals for the second."""

import jax.numpy as jnp
import numpy as np

from sainet.scenes.pushes import PushGrid
from sainet.scenes.scene import Scene
from sainet.scenes.state import at_rest
from sainet.tasks.push_to_goal import PushToGoal

RADIUS = (0.054, 0.059)  # m
FEW = PushGrid(contact_bins=3, direction_bins=2)  # 6 pushes


def single(values) -> jnp.ndarray:
    return jnp.asarray(values, jnp.float32)


def scene(table_friction=0.15) -> Scene:
    return Scene(
        mass=single([0.9, 1.0]),
        radius=single(RADIUS),
        table_friction=single(table_friction),
        disk_friction=single(0.25),
        pusher_friction=single(0.25),
        pusher_radius=single(0.0048),
    )


def touching(gap=0.0):
    """Both disks on a line that is neither axis."""
    away = sum(RADIUS) + gap
    second = [0.1 + away * np.cos(0.5), 0.2 + away * np.sin(0.5)]
    return at_rest(single([[0.1, 0.2], second]), single([0.3, -1]), single([0, 0.1]))


def goal_ahead(distance, angle=0.0, **settings) -> PushToGoal:
    """A goal at an angle (rad) from the axis of the disks, relative to disk 2."""
    place = np.asarray(touching().position[1])
    way = np.array([np.cos(0.5 + angle), np.sin(0.5 + angle)])
    return PushToGoal(single(place + distance * way), **settings)
