"""Many simulated tables at once, pushed in one compiled call of the planar engine."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from sainet.control.config import ControlConfig
from sainet.engines import make_engine
from sainet.planning.levels import batch_of
from sainet.robots.simulated import (
    DEEPEST,
    MASS,
    PUSH_STEPS,
    RADIUS,
    STILL,
    draw_friction,
    robot_generator,
    scene_of,
)
from sainet.scenes.controls import Controls
from sainet.scenes.pushes import Push
from sainet.scenes.scene import FrictionField, Scene, pusher_gaps
from sainet.scenes.state import State, at_rest
from sainet.tasks.obstacles import Way, draw_obstacles
from sainet.tasks.push_to_goal import draw_goal
from sainet.worlds.noise import (
    FRICTION_FEATURES,
    NoiseConfig,
    at_level,
    friction_features,
)
from sainet.worlds.sampling import in_a_row
from sainet.worlds.setups import RobotSetup
from sainet.worlds.world import SimulatedWorld

_NOISE = 0x7AB1E5  # stream of the noise of motion and measurement


@dataclass
class Tables:
    """Disks on many tables; every array has the axis `table` first.

    A table that begins a trial has its goal, start and frictions, as in `make_trial`.
    The noise of all tables comes from one generator.
    """

    config: ControlConfig
    pose: Float[np.ndarray, "table disk 3"]  # true (m, m, rad)
    measured: Float[np.ndarray, "table disk 3"]
    goal: Float[np.ndarray, "table 2"]  # m
    friction: Float[np.ndarray, " table"]
    field: dict[str, Float[np.ndarray, "table ..."]]  # of `FrictionField`
    rng: np.random.Generator

    @classmethod
    def empty(cls, config: ControlConfig, count: int) -> "Tables":
        """Return tables on which no trial has begun."""
        return cls(
            config=config,
            pose=np.zeros((count, config.disks, 3), np.float32),
            measured=np.zeros((count, config.disks, 3), np.float32),
            goal=np.zeros((count, 2), np.float32),
            friction=np.zeros(count, np.float32),
            field={
                "wave": np.zeros((count, FRICTION_FEATURES, 2), np.float32),
                "phase": np.zeros((count, FRICTION_FEATURES), np.float32),
                "amplitude": np.zeros(count, np.float32),
            },
            rng=np.random.default_rng(),
        )

    def seed(self, seeds: Sequence[int]) -> None:
        """Draw the noise from these numbers from here on."""
        self.rng = np.random.default_rng([_NOISE, *seeds])

    def begin(
        self,
        rows: Int[np.ndarray, " row"],
        seeds: Int[np.ndarray, " row"],
        trials: Int[np.ndarray, " row"],
    ) -> None:
        """Begin a trial on each of some tables, and measure their poses."""
        for table, seed, trial in zip(rows, seeds, trials, strict=True):
            self._begin_one(int(table), int(seed), int(trial))
        self.measured[rows] = self._world.capture(self.pose[rows][:, None])[:, 0]

    def _begin_one(self, table: int, seed: int, trial: int) -> None:
        rng = robot_generator(seed, trial)
        self.friction[table] = draw_friction(rng)
        for name, values in friction_features(rng, 1, self._noise).items():
            self.field[name][table] = values[0]
        place, target, radius = self._row, self.config.target, self._scene.radius
        goal = draw_goal(
            self.config.goals,
            seed,
            trial,
            disk=place[target],
            axis=0.0,
            radius=float(radius[target]),
        )
        if aside := self.config.obstacles:
            row, way = place[:-aside], Way(target, goal)
            others = draw_obstacles(seed, trial, way, row, np.asarray(radius))
            place = np.concatenate([row, others])
        self.goal[table] = goal
        self.pose[table] = np.pad(place, ((0, 0), (0, 1)))  # all angles are zero

    def push(self, push: Push) -> Bool[np.ndarray, " table"]:
        """Push on every table and measure; return which pushes had a trouble."""
        measured, truth = _state(self.measured), _state(self.pose)
        plain = _with_friction(self._scene, self.friction)
        planned, controls = _command(plain, measured, push)
        initial = at_rest(truth.position, truth.angle, planned.pusher_position)
        states = self._world.execute(self._roughened(plain), initial, controls).states
        end = np.concatenate(
            [states.position[:, -1], states.angle[:, -1, :, None]], axis=-1
        )
        moved = np.linalg.norm(end[:, 0, :2] - self.pose[:, 0, :2], axis=-1)
        inside = (np.asarray(_gaps(plain, initial))[:, 1:] < -DEEPEST).any(axis=-1)
        self.pose = end
        self.measured = self._world.capture(end[:, None])[:, 0]
        return ~(moved > STILL) | inside

    @property
    def success_radius(self) -> float:
        """The true distance from the goal that counts as success (m)."""
        return self.config.tolerance * float(self._scene.radius[self.config.target])

    @cached_property
    def _scene(self) -> Scene:
        """One scene with the true masses and radii."""
        return scene_of(MASS, RADIUS, self.config.disks, 0.0)

    @cached_property
    def _row(self) -> Float[np.ndarray, "disk 2"]:
        """Where the disks are before obstacles leave the row (m)."""
        return np.asarray(in_a_row(np.asarray(self._scene.radius)).position)

    @cached_property
    def _noise(self) -> NoiseConfig:
        return at_level(NoiseConfig(), self.config.noise_level)

    @property
    def _world(self) -> SimulatedWorld:
        engine = make_engine(self.config.world)
        return SimulatedWorld(engine, RobotSetup(), self._noise, self.rng, np.float32)

    def _roughened(self, scene: Scene) -> Scene:
        """Return the scenes with the friction fields of the tables."""
        if not self._noise.friction_fraction:
            return scene
        field = FrictionField(**{k: jnp.asarray(v) for k, v in self.field.items()})
        return eqx.tree_at(
            lambda s: s.friction_field, scene, field, is_leaf=lambda x: x is None
        )


def _state(pose: Float[np.ndarray, "table disk 3"]) -> State:
    found = jnp.asarray(pose)
    return at_rest(found[..., :2], found[..., 2], jnp.zeros((len(pose), 2)))


def _with_friction(scene: Scene, friction: Float[np.ndarray, " table"]) -> Scene:
    scenes = batch_of(scene, len(friction))
    return eqx.tree_at(lambda s: s.table_friction, scenes, jnp.asarray(friction))


@eqx.filter_jit
def _command(scene: Scene, state: State, push: Push) -> tuple[State, Controls]:
    return RobotSetup().command(scene, state, push, PUSH_STEPS)


_gaps = eqx.filter_jit(pusher_gaps)
