"""Rigid transforms between the frames of table, robot base and tracker."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

_FLATTEST = 1e-3  # second singular value of points on a line, relative to the first


@dataclass(frozen=True)
class Rigid:
    """A rigid transform x -> rotation x + shift; also the pose of a body in a frame."""

    rotation: Float[np.ndarray, "3 3"]
    shift: Float[np.ndarray, "3"]  # m

    def moved(self, points: Float[np.ndarray, "*point 3"]) -> Float[np.ndarray, "..."]:
        """Return points (m) in the other frame."""
        return points @ self.rotation.T + self.shift

    def after(self, first: "Rigid") -> "Rigid":
        """Return the transform that applies `first`, then this one."""
        return Rigid(self.rotation @ first.rotation, self.moved(first.shift))

    @property
    def inverse(self) -> "Rigid":
        """The transform back."""
        return Rigid(self.rotation.T, -self.shift @ self.rotation)

    @property
    def tilt(self) -> float:
        """The angle between the z axes of both frames (rad)."""
        return float(np.arccos(np.clip(self.rotation[2, 2], -1, 1)))

    @property
    def turn(self) -> float:
        """The rotation about z (rad): the twist, without the tilt."""
        (a, b, _), (c, d, _), _ = self.rotation
        return float(np.arctan2(c - b, a + d))


def fit_rigid(
    source: Float[np.ndarray, "point 3"], target: Float[np.ndarray, "point 3"]
) -> Rigid | None:
    """Return the transform of least squared residuals (Kabsch); None: on a line.

    It minimises sum |R s + t - x|^2 over rotations R and shifts t, for points s of the
    source and x of the target (m).
    """
    middle, aim = source.mean(axis=0), target.mean(axis=0)
    left, size, right = np.linalg.svd((target - aim).T @ (source - middle))
    if not size[1] > _FLATTEST * size[0]:
        return None
    mirrored = np.linalg.det(left @ right) < 0
    rotation = left @ np.diag([1.0, 1.0, -1.0 if mirrored else 1.0]) @ right
    return Rigid(rotation, aim - rotation @ middle)


def residuals(
    transform: Rigid,
    source: Float[np.ndarray, "point 3"],
    target: Float[np.ndarray, "point 3"],
) -> Float[np.ndarray, " point"]:
    """Return the distances (m) that a fitted transform leaves."""
    return np.linalg.norm(transform.moved(source) - target, axis=-1)
