"""Setups: how the pusher of simulated pushes is driven."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from jaxtyping import Float, Int
from numpy.random import Generator

from sainet.scenes.controls import Controls, ForceControls, PathControls
from sainet.scenes.pushes import Push, command_force, command_path
from sainet.scenes.scene import TIME_STEP, Scene
from sainet.scenes.state import State
from sainet.worlds.config import WorldConfig
from sainet.worlds.noise import NoiseConfig, force_error, tracking_error

Pushes = Float[np.ndarray, "*push"]  # one number for each push
Counts = Int[np.ndarray, "*push"]
_BUCKET = 40  # steps: pushes of nearly the same length share a compilation


@dataclass(frozen=True)
class AbstractSetup(ABC):
    """Makes controls, counts their steps and draws the errors of their execution."""

    config: WorldConfig = WorldConfig()

    @abstractmethod
    def steps(self, stroke: Pushes, speed: Pushes) -> Counts:
        """Return the number of steps of pushes, from stroke (m) and speed (m/s)."""

    @abstractmethod
    def command(
        self, scene: Scene, state: State, push: Push, steps: int
    ) -> tuple[State, Controls]:
        """Place the pusher and return the initial state and the controls.

        Args:
            scene: of each push.
            state: the disks at rest.
            push: one for each scene.
            steps: length of the controls.
        """

    @abstractmethod
    def error(
        self, controls: Controls, noise: NoiseConfig, rng: Generator, time_step: float
    ) -> Float[np.ndarray, "push time 2"]:
        """Draw the difference between the executed and the given command (m or N)."""

    @property
    def _gap(self) -> float:
        return self.config.gap_mm / 1000


class RobotSetup(AbstractSetup):
    """The pusher follows a path at constant speed, then holds."""

    def steps(self, stroke: Pushes, speed: Pushes) -> Counts:
        """Return the steps of motion and of holding: a multiple of 40, rounded up."""
        # A hair less than exact: 48.0000001 steps of motion are 48.
        moving = np.ceil(stroke / speed / TIME_STEP - 1e-6)
        whole = moving + self.config.hold_steps
        return np.asarray(np.ceil(whole / _BUCKET) * _BUCKET, int)

    def command(
        self, scene: Scene, state: State, push: Push, steps: int
    ) -> tuple[State, Controls]:
        """Command the path of the push."""
        return command_path(scene, state, push, steps=steps, gap=self._gap)

    def error(
        self, controls: Controls, noise: NoiseConfig, rng: Generator, time_step: float
    ) -> Float[np.ndarray, "push time 2"]:
        """Draw the tracking error (m), constant while the pusher holds."""
        velocity = np.asarray(controls.action)
        moving = np.abs(velocity).max(axis=-1) > 0
        return tracking_error(rng, moving, noise, time_step)


class ForceSetup(AbstractSetup):
    """A constant force drives the pusher."""

    def steps(self, stroke: Pushes, speed: Pushes) -> Counts:
        """Return the configured steps; stroke and speed have no effect."""
        return np.full(np.shape(stroke), self.config.force_steps)

    def command(
        self, scene: Scene, state: State, push: Push, steps: int
    ) -> tuple[State, Controls]:
        """Command the force along the push direction."""
        initial, controls = command_force(
            scene, state, push, force=self.config.force_n, steps=steps, gap=self._gap
        )
        return initial, replace(controls, damping=self.config.damping_n_s_m)

    def error(
        self, controls: Controls, noise: NoiseConfig, rng: Generator, time_step: float
    ) -> Float[np.ndarray, "push time 2"]:
        """Draw the error of the force (N), proportional to its size."""
        return force_error(rng, np.asarray(controls.command), noise, time_step)


SETUPS: Mapping[str, type[AbstractSetup]] = MappingProxyType(
    {PathControls.kind: RobotSetup, ForceControls.kind: ForceSetup}
)
