"""Networks and pushes that the tests of models, training and contracts share."""

from functools import lru_cache
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from msgspec import structs

from contracts.worlds import engine, pushed
from sainet.datasets.config import GenerateConfig
from sainet.engines.base import AbstractEngine, AssumedProperties
from sainet.engines.simulator import PAPER, InternalEngine
from sainet.identification.parameters import to_engine
from sainet.learning.recipes import PAPER as PAPER_RECIPE
from sainet.models.card import IDENTIFIED, Card, Identified
from sainet.models.correctors.interaction import InteractionNetwork, Scales
from sainet.models.dynamics import (
    AbstractDynamics,
    LearnedDynamics,
    PhysicsDynamics,
    SimulatorAugmented,
)
from sainet.models.features import feature_set
from sainet.models.identity import ModelId
from sainet.models.integrators import Acceleration, RelaxingResidual
from sainet.runs.documents import write_document
from sainet.runs.manifest import manifest
from sainet.scenes.controls import Controls
from sainet.scenes.scene import TIME_STEP, Scene
from sainet.scenes.state import State, Trajectory

PUSHES = 4
STEPS = 24
CARD = Card(
    identity=ModelId(kind="in"),
    kind="robot",
    time_step=TIME_STEP,
    truth_engine="planar",
    data="",
    disks=2,
    trained_pushes=4500,
    weights="",
    recipe=PAPER_RECIPE.settings(),
    manifest=manifest(),
)


@lru_cache
def network(
    model: str,
    kind: str,
    seed: int = 0,
    *,
    name: str = "paper",
    residual: bool = False,
) -> InteractionNetwork:
    """An untrained network with scales that matter and effects that are large."""
    features = feature_set(kind, simulator=model == "sain", name=name)
    rng = np.random.default_rng(seed)

    def drawn(low, high, size):
        return jnp.asarray(rng.uniform(low, high, size), jnp.float32)

    scales = Scales(
        pair_mean=drawn(-0.1, 0.1, features.pair_size),
        pair_deviation=drawn(0.1, 0.3, features.pair_size),
        body_mean=drawn(-0.1, 0.1, features.body_size),
        body_deviation=drawn(0.1, 0.3, features.body_size),
        acceleration=jnp.array([3.0, 3.0, 30.0]),
    )
    if features.has_simulator:  # how far a disk moves and turns in one step, after v_i
        step = jnp.array([5e-4, 5e-4, 2e-2])
        deviation = scales.body_deviation.at[3:6].set(step)
        shown = (scales.body_mean.at[3:6].set(0), deviation)
        where = lambda s: (s.body_mean, s.body_deviation)  # noqa: E731
        scales = eqx.tree_at(where, scales, shown)
    key = jax.random.key(seed)
    made = InteractionNetwork(
        features,
        time_step=TIME_STEP,
        key=key,
        scales=scales,
        integrator=RelaxingResidual() if residual else Acceleration(),
    )
    if residual:  # its output is zero: give it the last layer of another network
        made = eqx.tree_at(lambda n: n.dyn, made, network(model, kind, seed).dyn)
        return made
    layers, larger = (lambda n: (n.rel, n.dyn)), lambda w: 1.5 * w
    return eqx.tree_at(layers, made, jax.tree.map(larger, layers(made)))


class Glide(AbstractEngine):
    """Disks that drift off, the heavier the slower: an engine that compiles at once."""

    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        shape = (scene.mass.shape[0], controls.steps, scene.body_count)
        now = jnp.arange(1, controls.steps + 1) * scene.time_step
        now = jnp.broadcast_to(now[None, :, None], shape)
        rate = jnp.stack([0.03 / scene.mass, 20 * scene.radius**2], axis=-1)
        rate = jnp.broadcast_to(rate[:, None], (*shape, 2))
        path = now[..., None] ** 2 * rate + initial.position[:, None]
        velocity = 2 * now[..., None] * rate
        angle = initial.angle[:, None] + 0.2 * jnp.sin(40 * now)
        spin = 8 * jnp.cos(40 * now)
        pusher = jnp.broadcast_to(initial.pusher_position[:, None], (*shape[:2], 2))
        return Trajectory(State(path, angle, velocity, spin, pusher, 0 * pusher))


@lru_cache
def pushes(kind: str, bodies: int, steps: int = STEPS) -> tuple[Scene, State, Controls]:
    """Pushes of the paper somewhere on the table, at any angle, already in motion."""
    config = GenerateConfig(setup=kind, disks=bodies, pushes=PUSHES)
    scene, initial, controls = pushed(config, 3, steps)
    rng = np.random.default_rng(7)
    angle = jnp.asarray(rng.uniform(-3, 3, initial.angle.shape), jnp.float32)
    return scene, eqx.tree_at(lambda s: s.angle, initial, angle), controls


def assumed(order: list[int]) -> AssumedProperties:
    """The planar engine with the paper's properties, disks in another order."""
    mass, radius = (
        (*values, *[sum(values) / 2] * len(order))
        for values in (PAPER.mass, PAPER.radius)
    )
    assumptions = structs.replace(
        PAPER,
        mass=tuple(mass[i] for i in order),
        radius=tuple(radius[i] for i in order),
    )
    return AssumedProperties(engine("planar"), assumptions)


def dynamics(model: str, kind: str, order: list[int]) -> AbstractDynamics:
    """A model by name; its assumed properties follow the order of the disks."""
    if model == "physics":
        return PhysicsDynamics(assumed(order))
    if model == "in":
        return LearnedDynamics(network("in", kind))
    return SimulatorAugmented(network("sain", kind), assumed(order))


def quick_dynamics(model: str, kind: str) -> LearnedDynamics | SimulatorAugmented:
    """IN, or SAIN around an engine that compiles at once."""
    if model == "in":
        return LearnedDynamics(network("in", kind))
    return SimulatorAugmented(network("sain", kind), Glide())


def identified_folder(folder: Path, **values: float) -> InternalEngine:
    """Writes identified parameters into a folder; returns the engine with them."""
    engine = to_engine(values)
    errors = dict.fromkeys(("before_mm", "after_mm", "before_deg", "after_deg"), 1.0)
    found = Identified(engine=engine, estimates=(), pushes=1, **errors)
    write_document(folder / IDENTIFIED, found)
    return engine
