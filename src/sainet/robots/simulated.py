"""A robot in a simulated world: rough table, noisy motion and noisy poses."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from sainet.engines import make_engine
from sainet.robots import RobotConfig
from sainet.robots.base import AbstractRobot
from sainet.scenes.pushes import Push, check_push
from sainet.scenes.recording import Recording
from sainet.scenes.scene import Scene, pusher_gaps
from sainet.scenes.state import State, at_rest, in_a_row, poses_of
from sainet.worlds.config import WorldConfig, bounds
from sainet.worlds.noise import NoiseConfig, at_level
from sainet.worlds.setups import RobotSetup
from sainet.worlds.world import SimulatedWorld

# True properties of the disks, which differ from the assumed properties.
MASS = (0.9, 1.0)  # kg
RADIUS = (0.054, 0.059)  # m
_WORLD = 0x3071D
PUSH_STEPS = 200  # 48 of motion; then the pusher holds while the disks come to rest


class SimulatedRobot(AbstractRobot):
    """Executes pushes in a simulated world; a surrogate for tests and comparisons."""

    def __init__(self, world: SimulatedWorld, scene: Scene, state: State) -> None:
        """Put the disks on the table.

        Args:
            world: of the robot setup; executes the pushes.
            scene: one scene with the true properties.
            state: poses of the disks.
        """
        self._world = world
        self._scene = world.roughen(scene)
        self._truth = state
        self._measured = state

    @property
    def scene(self) -> Scene:
        """The true properties, with the friction of the rough table."""
        return self._scene

    @property
    def truth(self) -> State:
        """The true poses."""
        return self._truth

    def arrange(self, state: State) -> None:
        """Put the disks and the pusher at these poses (m, rad), at rest."""
        self._truth = at_rest(state.position, state.angle, state.pusher_position)
        self._measured = self._truth

    def resume(self, left: State | None, *seed: int) -> None:
        """Put the disks back where a push left them, and draw noise anew."""
        self._world = replace(self._world, rng=robot_generator(*seed))
        if left is not None:
            self.arrange(left)

    def observe(self) -> State:
        """Return the measured poses; velocities are zero."""
        pose = jnp.asarray(self._world.capture(poses_of(self._truth)[None, None])[0, 0])
        self._measured = eqx.tree_at(
            lambda s: (s.position, s.angle), self._truth, (pose[:, :2], pose[:, 2])
        )
        return self._measured

    def push(self, push: Push) -> Recording:
        """Push from where the disks were last measured; record measured poses.

        Args:
            push: one push (rad, rad, m, m/s), without a batch axis.
        """
        check_push(push)
        # In the engine's batches: one scene, one push.
        scene, measured, truth, one = jax.tree.map(
            lambda x: jnp.asarray(x)[None],
            (self._scene, self._measured, self._truth, push),
        )
        plain = eqx.tree_at(lambda s: s.friction_field, scene, None)
        planned, controls = self._world.setup.command(plain, measured, one, PUSH_STEPS)
        initial = at_rest(truth.position, truth.angle, planned.pusher_position)
        states = self._world.execute(scene, initial, controls).states
        end = jax.tree.map(lambda x: x[0, -1], states)
        self._truth = at_rest(end.position, end.angle, end.pusher_position)
        before, after = jax.tree.map(lambda x: np.asarray(x)[0], (initial, states))
        pose = np.concatenate([poses_of(before)[None], poses_of(after)])
        path = [before.pusher_position[None], after.pusher_position]
        # A generator of their own: measured poses leave all other noise unchanged.
        (rng,) = self._world.rng.spawn(1)
        return Recording(
            time=scene.time_step * np.arange(len(pose)),
            pose=replace(self._world, rng=rng).capture(pose[None])[0],
            pusher=np.concatenate(path),
            commanded=push,
            trouble=_start_trouble(plain, initial) or _trouble(pose),
        )


def robot_generator(*seed: int) -> np.random.Generator:
    """Return the generator of a robot's table and noise."""
    return np.random.default_rng([_WORLD, *seed])


def simulated_robot(config: RobotConfig, *seed: int) -> SimulatedRobot:
    """Return a robot in a world whose friction and noise are drawn from numbers."""
    rng = robot_generator(*seed)
    friction = draw_friction(rng)
    scene = scene_of(MASS, RADIUS, config.disks, friction)
    return _robot(config, scene, rng)


def robot_among(config: RobotConfig, scene: Scene, *seed: int) -> SimulatedRobot:
    """Return a robot among disks with these true properties, in a row.

    Args:
        config: world and noise.
        scene: one scene; its table friction is not drawn.
        seed: numbers from which the noise is drawn.
    """
    return _robot(config, scene, robot_generator(*seed))


def _robot(
    config: RobotConfig, scene: Scene, rng: np.random.Generator
) -> SimulatedRobot:
    noise = at_level(NoiseConfig(), config.noise_level)
    engine = make_engine(config.world)
    world = SimulatedWorld(engine, RobotSetup(), noise, rng, np.float32)
    return SimulatedRobot(world, scene, in_a_row(np.asarray(scene.radius)))


def draw_friction(rng: np.random.Generator) -> float:
    """Return the friction coefficient of a random table."""
    return float(rng.uniform(*bounds(WorldConfig.table_friction)))


def scene_of(
    mass: tuple[float, ...], radius: tuple[float, ...], disks: int, friction: float
) -> Scene:
    """Return a scene; disks beyond the listed ones have the mean of both values."""

    def each(values: tuple[float, ...]) -> tuple[float, ...]:
        mean = sum(values) / len(values)
        return (*values, *[mean] * disks)[:disks]

    return Scene.disks(each(mass), each(radius), table_friction=friction)


STILL = 1e-4  # m, of disk 1: a push that moves it less is useless
DEEPEST = 1e-3  # m, more than the noise of motion capture


def _start_trouble(scene: Scene, initial: State) -> str:
    """Return whether the pusher starts inside another disk than the pushed one."""
    depth = -np.asarray(pusher_gaps(scene, initial))[0, 1:]
    if not (depth > DEEPEST).any():
        return ""
    disk = 2 + int(np.argmax(depth))
    return f"the pusher began {1000 * depth.max():.1f} mm inside disk {disk}"


def _trouble(pose: Float[np.ndarray, "sample body 3"]) -> str:
    """Return why a push that was executed is useless, empty if it is not."""
    if not np.isfinite(pose).all():
        return "simulation produced NaN or infinity"
    moved = np.linalg.norm(pose[-1, 0, :2] - pose[0, 0, :2])
    return "" if moved > STILL else "disk 1 did not move"
