"""What every engine can do."""

from abc import abstractmethod

import equinox as eqx

from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory


class AbstractEngine(eqx.Module):
    """Predicts how a scene moves under controls, from first principles."""

    @abstractmethod
    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Return the states after each step of the controls (eq. 2: open loop).

        All arguments share their leading batch axes. The final state holds all that
        is needed to go on: two rollouts in a row equal one long rollout.
        """

    @property
    def on_host(self) -> bool:
        """Whether it works outside JAX: no compiled function may hold its rollouts."""
        return False


def roll_out(
    engine: AbstractEngine, scene: Scene, initial: State, controls: Controls
) -> Trajectory:
    """Roll any engine out, compiled once for each set of shapes where it can be."""
    if engine.on_host:
        return engine.rollout(scene, initial, controls)
    return _compiled(engine, scene, initial, controls)


@eqx.filter_jit
def _compiled(
    engine: AbstractEngine, scene: Scene, initial: State, controls: Controls
) -> Trajectory:
    return engine.rollout(scene, initial, controls)
