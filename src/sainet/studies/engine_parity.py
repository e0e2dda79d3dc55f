"""Differences of the planar engine from Bullet, and of Bullet in a rotated scene.

The ground truth is Bullet without noise; all engines have the true properties. Bullet
is not isotropic: its difference from itself is the best possible result.
"""

import jax.numpy as jnp
import numpy as np

from sainet.datasets.config import GenerateConfig
from sainet.engines import make_engine
from sainet.engines.base import AbstractEngine
from sainet.engines.planar.engine import PlanarEngine
from sainet.evaluation.measurements import Condition
from sainet.models.dynamics import PhysicsDynamics
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.report.figures.overview import draw_errors
from sainet.scenes.controls import Controls
from sainet.scenes.geometry import rotate
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory
from sainet.studies.runner import Runner
from sainet.studies.steps import Evaluate, Join, Simulate, Step
from sainet.studies.study import Plan, Scope, Study
from sainet.worlds.config import SetupName

PUSHES = 200
_SETUPS: tuple[SetupName, ...] = ("robot", "direct-force")
# Of a uniform pressure: the ratio for pure rotation, and for rotation while sliding
# (the root of <r^2> / 2), where the ellipsoid of the planar engine resists too much.
_RATIOS = (2 / 3, 0.5)


class TurnedEngine(AbstractEngine):
    """Wrapper that rotates the scene, and rotates the motion back."""

    engine: AbstractEngine
    angle: float  # rad

    @property
    def on_host(self) -> bool:
        """Whether the wrapped engine works outside JAX."""
        return self.engine.on_host

    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Return the rollout of the wrapped engine in the rotated scene."""
        turned = turn_state(initial, self.angle)
        controls = controls.turned(jnp.asarray(self.angle))
        states = self.engine.rollout(scene, turned, controls).states
        return Trajectory(turn_state(states, -self.angle))


def turn_state(state: State, angle: float) -> State:
    """Return a state rotated about the origin of the table (rad)."""
    return State(
        position=rotate(state.position, jnp.asarray(angle)),
        angle=state.angle + angle,
        velocity=rotate(state.velocity, jnp.asarray(angle)),
        spin=state.spin,
        pusher_position=rotate(state.pusher_position, jnp.asarray(angle)),
        pusher_velocity=rotate(state.pusher_velocity, jnp.asarray(angle)),
    )


class TrueEngine(Step[Model]):
    """An engine with the true properties: planar, or Bullet in a rotated scene."""

    pressure_radius_ratio: float | None = None  # of the planar engine
    turned_deg: int = 0  # of Bullet

    @property
    def name(self) -> str:
        """The name in tables."""
        if self.pressure_radius_ratio is None:
            return f"bullet-at-{self.turned_deg}-deg"
        return f"planar-{self.pressure_radius_ratio:.2f}"

    def run(self, runner: Runner) -> Model:
        """Return the model."""
        if self.pressure_radius_ratio is None:
            angle = np.deg2rad(self.turned_deg)
            engine: AbstractEngine = TurnedEngine(make_engine("bullet"), angle)
        else:
            engine = PlanarEngine(pressure_radius_ratio=self.pressure_radius_ratio)
        return Model(ModelId(kind="physics", name=self.name), PhysicsDynamics(engine))


def _plan(scope: Scope) -> Plan:
    """Return the comparison on random pushes of each setup, equal at both scales."""
    engines = (
        *(TrueEngine(pressure_radius_ratio=ratio) for ratio in _RATIOS),
        *(TrueEngine(turned_deg=degrees) for degrees in (20, 45)),
    )
    parts = []
    for setup in _SETUPS:
        config = GenerateConfig(
            setup=setup, pushes=PUSHES, engine="bullet", noise_level="none", seed=2
        )
        condition = Condition(label=setup, factors={"setup": setup})
        pushes = Simulate(f"{setup}-without-noise", config)
        parts.append(Evaluate(engines, pushes, condition))
    return Plan(Join(tuple(parts)))


STUDY = Study(
    question="How far is the planar engine from Bullet, and Bullet from itself in a "
    "rotated scene?",
    plan=_plan,
    compares=False,
    figure=draw_errors,
)
