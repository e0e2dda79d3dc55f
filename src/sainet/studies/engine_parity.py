"""Differences of the planar engine from Bullet, and of Bullet in a rotated scene.

The ground truth is Bullet without noise; all engines have the true properties. Bullet
is not isotropic: its difference from itself is the best possible result.
"""

import jax.numpy as jnp
import msgspec
import numpy as np

from sainet.datasets.config import GenerateConfig
from sainet.engines import make_engine
from sainet.engines.base import AbstractEngine
from sainet.engines.planar.engine import PlanarEngine
from sainet.evaluation.conditions import Condition
from sainet.evaluation.joining import join
from sainet.evaluation.summary import summarise
from sainet.models.dynamics import PhysicsDynamics
from sainet.models.identity import ModelId
from sainet.models.library import Model
from sainet.scenes.controls import Controls
from sainet.scenes.geometry import rotate
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.result import Result
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


def run(scale: Scale, chain: Chain) -> Result:
    """Return a table that compares the engines on 200 random pushes of each setup."""
    del scale  # both scales are equal
    parts = []
    for setup in _SETUPS:
        config = GenerateConfig(
            setup=setup, pushes=PUSHES, engine="bullet", noise_level="none", seed=2
        )
        store = chain.simulate(setup, config)
        condition = Condition(label=setup, factors={"setup": setup})
        parts.append(chain.compare(_engines(), store).in_condition(condition))
    found = join(parts)
    # Engines are compared with the truth, not with each other.
    summary = msgspec.structs.replace(summarise(found), comparisons=())
    return chain.finish(Result(summary=summary), measurements=found)


def _engines() -> list[Model]:
    engines: dict[str, AbstractEngine] = {
        f"planar-{ratio:.2f}": PlanarEngine(pressure_radius_ratio=ratio)
        for ratio in _RATIOS
    }
    bullet = make_engine("bullet")
    engines |= {
        f"bullet-at-{degrees}-deg": TurnedEngine(bullet, np.deg2rad(degrees))
        for degrees in (20, 45)
    }
    return [
        Model(ModelId(kind="physics", name=name), PhysicsDynamics(engine))
        for name, engine in engines.items()
    ]
