"""Errors of predicted pushes: the paper's three, and three that say more."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

REFERENCE_DISTANCE = {"simulated": 0.25, "recorded": 0.345}  # m, for trans (%)


@dataclass(frozen=True)
class PushErrors:
    """Errors of one model, for each push and body; maybe of several trainings."""

    pos_mm: Float[np.ndarray, "... push body"]  # mean over the observed steps
    rot_deg: Float[np.ndarray, "... push body"]  # mean over the observed steps
    final_pos_mm: Float[np.ndarray, "... push body"]
    final_rot_deg: Float[np.ndarray, "... push body"]

    @property
    def trainings(self) -> int:
        """How often the model was trained."""
        return len(self.pos_mm) if self.pos_mm.ndim > 2 else 1  # noqa: PLR2004

    def of_pushes(self, part: np.ndarray) -> "PushErrors":
        """Return the errors of some pushes."""
        return PushErrors(**{k: v[..., part, :] for k, v in vars(self).items()})


def pooled(trainings: Sequence[PushErrors]) -> PushErrors:
    """Return the errors of one model that was trained several times."""
    names = vars(trainings[0])
    return PushErrors(
        **{name: np.stack([getattr(one, name) for one in trainings]) for name in names}
    )


def push_errors(
    predicted: Float[np.ndarray, "push time body 3"],
    true: Float[np.ndarray, "push time body 3"],
    observed: Bool[np.ndarray, "push time"],
) -> PushErrors:
    """Return the errors of predicted poses (m, rad) where the true ones are known."""
    offset = predicted - np.where(observed[..., None, None], true, predicted)
    position = 1000 * np.linalg.norm(offset[..., :2], axis=-1)
    # An angle error is never more than half a turn.
    rotation = np.abs(np.rad2deg(_wrap(offset[..., 2])))
    return PushErrors(
        pos_mm=_mean_over_time(position, observed),
        rot_deg=_mean_over_time(rotation, observed),
        final_pos_mm=_last(position, observed),
        final_rot_deg=_last(rotation, observed),
    )


def final_errors(
    predicted: Float[np.ndarray, "push body 3"], true: Float[np.ndarray, "push body 3"]
) -> PushErrors:
    """Return the errors of predicted final poses; the means over time are unknown."""
    seen = np.ones((len(true), 1), bool)
    ends = push_errors(predicted[:, None], true[:, None], seen)
    unknown = np.full_like(ends.pos_mm, np.nan)
    return PushErrors(unknown, unknown, ends.final_pos_mm, ends.final_rot_deg)


def travel_mm(
    initial: Float[np.ndarray, "push body 3"], final: Float[np.ndarray, "push body 3"]
) -> Float[np.ndarray, "push body"]:
    """Return how far each body was moved (mm)."""
    return 1000 * np.linalg.norm(final[..., :2] - initial[..., :2], axis=-1)


def final_pose(
    pose: Float[np.ndarray, "push time body 3"], observed: Bool[np.ndarray, "push time"]
) -> Float[np.ndarray, "push body 3"]:
    """Return the last observed pose of each push; NaN if none was observed."""
    return _last(pose, observed)


def _mean_over_time(error: np.ndarray, observed: np.ndarray) -> np.ndarray:
    count = observed.sum(axis=1).astype(float)
    summed = np.where(observed[..., None], error, 0.0).sum(axis=1)
    return summed / np.where(count, count, np.nan)[:, None]


def _last(values: np.ndarray, observed: np.ndarray) -> np.ndarray:
    """Return what belongs to the last observed step of each push, else NaN."""
    last = observed.shape[1] - 1 - np.argmax(observed[:, ::-1], axis=1)
    seen = observed.any(axis=1).reshape(-1, *[1] * (values.ndim - 2))
    return np.where(seen, values[np.arange(len(values)), last], np.nan)


def _wrap(angle: np.ndarray) -> np.ndarray:
    return np.mod(angle + np.pi, 2 * np.pi) - np.pi
