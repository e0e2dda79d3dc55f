"""The interface of engines."""

from abc import abstractmethod

import equinox as eqx

from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory


class AbstractEngine(eqx.Module):
    """A physics engine, which simulates the motion of a scene under controls."""

    @abstractmethod
    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Return the states after each step of the controls (eq. 2: open loop).

        All arguments share their leading batch axes. The final state is complete: two
        consecutive rollouts equal one long rollout.
        """

    @property
    def on_host(self) -> bool:
        """Whether it runs outside JAX, so that its rollouts cannot be compiled."""
        return False


def roll_out(
    engine: AbstractEngine, scene: Scene, initial: State, controls: Controls
) -> Trajectory:
    """Return the rollout of any engine, compiled once per set of shapes if possible."""
    if engine.on_host:
        return engine.rollout(scene, initial, controls)
    return _compiled(engine, scene, initial, controls)


@eqx.filter_jit
def _compiled(
    engine: AbstractEngine, scene: Scene, initial: State, controls: Controls
) -> Trajectory:
    return engine.rollout(scene, initial, controls)
