"""What every engine can do."""

from abc import abstractmethod

import equinox as eqx

from sainet.pushes import Controls
from sainet.scene import Scene, State, Trajectory


class AbstractEngine(eqx.Module):
    """Predicts how a scene moves under controls, from first principles."""

    @abstractmethod
    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Return the states after each step of the controls (eq. 2: open loop).

        All arguments share their leading batch axes. The final state holds all that
        is needed to go on: two rollouts in a row equal one long rollout.
        """
