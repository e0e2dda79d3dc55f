"""Scenes that are mirrored, turned, moved or renumbered, and motions likewise."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State


class Placement(NamedTuple):
    """Mirrors about the x axis where `mirror` is -1, then turns, then moves."""

    mirror: float = 1.0
    turn: float = 0.0  # rad
    shift: tuple[float, float] = (0.0, 0.0)  # m

    def vector(self, values):
        values = np.asarray(values, np.float64)
        x, y = values[..., 0], self.mirror * values[..., 1]
        cosine, sine = np.cos(self.turn), np.sin(self.turn)
        return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)

    def point(self, values):
        return self.vector(values) + np.array(self.shift)

    def state(self, state: State) -> State:
        return State(
            position=single(self.point(state.position)),
            angle=single(self.mirror * np.asarray(state.angle, float) + self.turn),
            velocity=single(self.vector(state.velocity)),
            spin=self.mirror * state.spin,
            pusher_position=single(self.point(state.pusher_position)),
            pusher_velocity=single(self.vector(state.pusher_velocity)),
        )

    def controls(self, controls: Controls) -> Controls:
        placed = jax.tree.map(lambda vector: single(self.vector(vector)), controls)
        if controls.pusher_path is None:
            return placed
        path = single(self.point(controls.pusher_path))
        return eqx.tree_at(lambda c: c.position, placed, path)


def single(values) -> jax.Array:
    """Rounds to what engines compute in."""
    return jnp.asarray(values, jnp.float32)


def renumber_scene(scene: Scene, order: list[int]) -> Scene:
    """The same scene with its disks in another order."""
    picked = (scene.mass[..., order], scene.radius[..., order])
    return eqx.tree_at(lambda s: (s.mass, s.radius), scene, picked)


def renumber_state(state: State, order: list[int]) -> State:
    """The same states with the disks in another order."""
    return State(
        position=state.position[..., order, :],
        angle=state.angle[..., order],
        velocity=state.velocity[..., order, :],
        spin=state.spin[..., order],
        pusher_position=state.pusher_position,
        pusher_velocity=state.pusher_velocity,
    )
