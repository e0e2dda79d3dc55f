"""Scenes, controls and rollouts that the contracts of every engine share."""

from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec

import jax
import jax.numpy as jnp
import numpy as np

from sainet.datasets.config import GenerateConfig
from sainet.engines import make_engine
from sainet.engines.base import AbstractEngine
from sainet.scenes.controls import Controls, PathControls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State
from sainet.worlds.sampling import Draws, draw
from sainet.worlds.setups import SETUPS
from support import require

FAR = 10.0  # m, where a pusher touches nothing


@dataclass(frozen=True)
class Tolerance:
    """How closely an engine has to obey the physics."""

    pressure_ratio: float  # mean distance of the table's pressure over the radius
    stopping: float  # relative, of stopping distances, angles and times
    yaw: float  # rad, that a coasting disk turns
    rest: float  # m and m/s, of what rests
    overlap: dict[int, float]  # m, by which so many pushed disks sink in
    overlap_left: float  # m, of an overlap at the start after a second
    path: float  # m, by which the quasi-static path depends on the table's friction
    symmetry: float  # m, mean over scenes that are mirrored, turned or moved
    worst_symmetry: float  # m, of the worst of them at its worst moment
    permutation: float  # m, of disks that trade places
    advance: float  # m, of a rollout in two parts
    energy: float  # relative growth in a step
    still_energy: float  # J, of a resting disk that trembles
    momentum: float  # relative
    impact: float  # m/s, of a disk that is pushed at 50 mm/s
    parting: float  # m/s, of disks that met at up to 1 m/s
    impact_steps: int  # that an impact takes
    differentiable: bool


TOLERANCES = {
    # Its solver is iterative, its friction cone is not quite round, contact points lie
    # at any height of a disk's side, and a continued rollout has lost its contacts.
    "bullet": Tolerance(
        pressure_ratio=2 / 3,
        stopping=0.05,
        yaw=np.deg2rad(0.5),
        rest=1e-9,
        overlap={1: 1e-4, 2: 1e-4, 3: 1e-4, 5: 2.5e-4},
        overlap_left=5e-5,
        path=5e-5,
        symmetry=3e-4,
        worst_symmetry=5e-3,
        permutation=3e-3,
        advance=2e-4,
        energy=0.15,
        still_energy=1e-6,
        momentum=1e-3,
        impact=1.5e-3,
        parting=0.1,
        impact_steps=2,
        differentiable=False,
    ),
    "planar": Tolerance(
        pressure_ratio=2 / 3,
        stopping=0.02,
        yaw=1e-6,
        rest=0.0,
        overlap={1: 1e-6, 2: 2.5e-5, 3: 7e-5, 5: 2.5e-4},
        overlap_left=5e-6,
        path=5e-5,
        symmetry=1e-5,
        worst_symmetry=1e-5,
        permutation=3e-4,
        advance=0.0,
        energy=1e-5,
        still_energy=1e-11,
        momentum=1e-5,
        impact=1e-5,
        parting=1e-5,
        impact_steps=1,
        differentiable=True,
    ),
}


@lru_cache
def engine(name: str) -> AbstractEngine:
    """One engine of each name for all tests, so that compiled rollouts are shared."""
    require(name != "bullet" or find_spec("pybullet"), "PyBullet is not installed")
    return make_engine(name)


def make_scene(mass, radius, *, table=0.2, contact=0.25, pusher_radius=0.0048) -> Scene:
    """A batch of scenes; frictions are numbers or one for each scene."""
    mass = jnp.asarray(np.asarray(mass), jnp.float32)
    batch = mass.shape[:1]
    contact = full(batch, contact)
    return Scene(
        mass=mass,
        radius=jnp.asarray(np.asarray(radius), jnp.float32),
        table_friction=full(batch, table),
        disk_friction=contact,
        pusher_friction=contact,
        pusher_radius=full(batch, pusher_radius),
    )


def full(batch: tuple[int, ...], value) -> jax.Array:
    """One number for each scene."""
    return jnp.asarray(np.broadcast_to(np.asarray(value), batch), jnp.float32)


def moving(position, velocity, spin=0.0) -> State:
    """A batch of states with the pusher far away at rest."""
    position = jnp.asarray(np.asarray(position), jnp.float32)
    pusher = jnp.full_like(position[:, 0], FAR)
    shape = position.shape[:-1]
    return State(
        position=position,
        angle=jnp.zeros(shape),
        velocity=jnp.asarray(np.broadcast_to(velocity, position.shape), jnp.float32),
        spin=jnp.asarray(np.broadcast_to(spin, shape), jnp.float32),
        pusher_position=pusher,
        pusher_velocity=jnp.zeros_like(pusher),
    )


def far_away(batch: int, steps: int) -> PathControls:
    """The pusher stays where `moving` puts it."""
    return PathControls(
        position=jnp.full((batch, steps, 2), FAR), velocity=jnp.zeros((batch, steps, 2))
    )


def pushed(
    config: GenerateConfig, seed: int, steps: int, **frictions
) -> tuple[Scene, State, Controls]:
    """Scenes and pushes with the paper's distributions, without noise."""
    draws = draw(config, np.random.default_rng(seed), config.pushes)
    scene = make_scene(
        draws.mass, draws.radius, **({"table": draws.table_friction} | frictions)
    )
    return scene, *push_of(config, scene, draws, steps)


def push_of(
    config: GenerateConfig, scene: Scene, draws: Draws, steps: int
) -> tuple[State, Controls]:
    """The initial states and the controls of drawn pushes."""
    setup = SETUPS[config.setup](config)
    return setup.command(scene, draws.state(), draws.push(), steps)


def first_steps(controls: Controls, steps: int) -> Controls:
    """The first steps of controls."""
    return _cut(controls, slice(None, steps))


def later_steps(controls: Controls, start: int) -> Controls:
    """The steps of controls from one on."""
    return _cut(controls, slice(start, None))


def _cut(controls: Controls, part: slice) -> Controls:
    has_time = controls.command.ndim
    return jax.tree.map(lambda x: x[:, part] if x.ndim == has_time else x, controls)


def together(*trees):
    """Puts batches behind each other, so that one rollout does them all."""
    return jax.tree.map(lambda *parts: jnp.concatenate(parts), *trees)


def rows(tree, part: slice):
    """Some scenes of a batch."""
    return jax.tree.map(lambda x: x[part], tree)


def over_time(scene: Scene, steps: int) -> Scene:
    """The scene once for each step, beside states that have a time axis."""

    def repeat(x):
        return jnp.broadcast_to(x[:, None], (x.shape[0], steps, *x.shape[1:]))

    return jax.tree.map(repeat, scene)


def free_scenes(
    rng: np.random.Generator, batch: int, bodies: int, **frictions
) -> tuple[Scene, State]:
    """Crowded random scenes without overlap in which everything moves and spins."""
    radius = rng.uniform(0.04, 0.07, (batch, bodies))
    position = np.stack([_crowd(rng, one) for one in radius])
    scene = make_scene(rng.uniform(0.5, 2.0, (batch, bodies)), radius, **frictions)
    velocity = rng.normal(0, 0.4, position.shape) - 2 * position
    return scene, moving(position, velocity, rng.normal(0, 5, (batch, bodies)))


def _crowd(rng: np.random.Generator, radius: np.ndarray) -> np.ndarray:
    placed: list[np.ndarray] = []
    while len(placed) < len(radius):
        place = rng.uniform(-0.2, 0.2, 2)
        reach = radius[: len(placed)] + radius[len(placed)] + 1e-4
        if all(
            np.hypot(*(place - other)) > r
            for other, r in zip(placed, reach, strict=True)
        ):
            placed.append(place)
    return np.stack(placed)
