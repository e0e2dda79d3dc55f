"""Correctors: they predict motion, with or without a simulator prediction."""

from abc import abstractmethod
from typing import NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from sainet.models.inputs import PushFrame
from sainet.runs.errors import BadCheckpoint
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory


class Start(eqx.Module):
    """States at which a prediction starts or continues."""

    predicted: State  # s-hat, fed back to the corrector
    frame: PushFrame  # of the push, fixed since its start
    simulated: State | None = None  # s-bar, fed back to the engine; None without one
    first: State | None = None  # at which the push began; None without an engine


class Prediction(eqx.Module):
    """A model prediction and its uncertainty."""

    trajectory: Trajectory
    # Standard deviation of poses (m, m, rad); None where the corrector has none.
    deviation: Float[Array, "push time body 3"] | None = None


CONFIDENCE = 0.9  # probability that a region holds the end of a push


def interval_score(width: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return half the interval score of Gneiting and Raftery (2007), smaller is better.

    It is the half width of an interval, plus ten times what an error lies outside.
    """
    return width + np.maximum(error - width, 0.0) / (1 - CONFIDENCE)


class Region(NamedTuple):
    """Where a push ends with the probability `CONFIDENCE`: an ellipse, and an interval.

    Each holds with this probability apart: the ellipse for positions, the interval
    for angles.
    """

    heading: Float[Array, " push"]  # rad, of the first axis of the ellipse
    axes: Float[Array, "push body 2"]  # m, half axes along and across the push
    turn: Float[Array, "push body"]  # rad, half width of the interval
    # Position (m) and rotation (rad) of regions that are as large for every push.
    plain: Float[Array, "push body 2"]


class Purpose(NamedTuple):
    """The pushes that a corrector is for."""

    kind: str  # of the setup that makes the controls
    time_step: float  # s
    disks: int | None = None  # of every scene; None: any number

    def check_disks(self, disks: int, source: str = "model") -> None:
        """Raise `BadCheckpoint` if the corrector takes another number of disks."""
        if self.disks not in (None, disks):
            raise BadCheckpoint(
                f"{source}: takes {self.disks} disk(s), not {disks}; use a network for "
                "any number, or fit such a model to pushes of so many disks."
            )


class AbstractCorrector(eqx.Module):
    """Predicts pushes by correcting a simulator prediction, or without one."""

    @property
    @abstractmethod
    def made_for(self) -> Purpose:
        """The pushes that the corrector is for."""

    @property
    def has_regions(self) -> bool:
        """Whether `region` states where pushes end."""
        return False

    @abstractmethod
    def correct(
        self,
        scene: Scene,
        start: Start,
        controls: Controls,
        simulated: Trajectory | None,
    ) -> Prediction:
        """Predict the states after each step of the controls.

        Args:
            scene: of each push.
            start: of each push.
            controls: of each push, in the table frame.
            simulated: simulator prediction, in the table frame; None without an engine.
        """

    def region(self, scene: Scene, start: Start, controls: Controls) -> Region | None:
        """Return the regions in which pushes end; None where they are not known."""
        del scene, start, controls
        return None
