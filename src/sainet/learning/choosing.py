"""Which push to record next: the one that reduces the variance of predictions most.

The criterion is that of Cohn, Ghahramani and Jordan (1996), "Active learning with
statistical models": the variance of a Gaussian process depends on its inputs alone, so
that its expected reduction over all possible pushes is known before a push is made.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import cho_solve, cholesky

from sainet.datasets.store import open_store
from sainet.learning.process_ends import inputs_of
from sainet.models.process_card import (
    Fitted,
    ProcessCard,
    covariance_between,
    read_process,
)
from sainet.runs.errors import BadInput

GRID = 1024  # possible pushes, drawn at random
_SEED = 0


def choose_pushes(
    fitted: Fitted, possible: Float[np.ndarray, "push input"], count: int
) -> tuple[Int[np.ndarray, " chosen"], Float[np.ndarray, " chosen"]]:
    """Return the rows of the next pushes, in order, and what each leaves of variance.

    Args:
        fitted: the process of the pushes so far.
        possible: inputs of pushes that could be made, also those that matter.
        count: of the pushes, at most those that are possible.

    Returns:
        The rows, and the mean variance of predictions after each push, as a fraction of
        that before the first.
    """
    points = (possible - fitted.centre) / fitted.width
    known = [_left(fitted, points, output) for output in range(len(fitted.outputs))]
    before = _mean_variance(known)
    chosen, left = np.empty(count, int), np.empty(count)
    free = np.ones(len(points), bool)
    for place in range(count):
        gain = np.sum(
            [
                np.sum(each**2, axis=0) / (np.diag(each) + noise)
                for each, noise in zip(known, fitted.noise, strict=True)
            ],
            axis=0,
        )
        best = int(np.argmax(np.where(free, gain, -np.inf)))
        chosen[place], free[best] = best, False
        for each, noise in zip(known, fitted.noise, strict=True):
            row = each[best].copy()
            np.subtract(each, np.outer(row, row) / (row[best] + noise), out=each)
        left[place] = _mean_variance(known) / before
    return chosen, left


def _left(
    fitted: Fitted, points: Float[np.ndarray, "push input"], output: int
) -> Float[np.ndarray, "push push"]:
    """Return the covariance that the pushes so far leave of one output."""
    own = covariance_between(fitted, output, fitted.inputs, fitted.inputs)
    own[np.diag_indices_from(own)] += fitted.noise[output]
    across = covariance_between(fitted, output, fitted.inputs, points)
    whole = covariance_between(fitted, output, points, points)
    return whole - across.T @ cho_solve((cholesky(own, lower=True), True), across)


def _mean_variance(known: list[Float[np.ndarray, "push push"]]) -> float:
    return float(np.mean([np.diag(each) for each in known]))


@dataclass(frozen=True)
class Proposal:
    """A push of one disk that could be made."""

    x: float  # m, of the disk on the table
    y: float  # m
    angle: float  # rad, of the disk
    contact_angle: float  # rad, of the contact normal on the table
    direction: float  # rad, of the push from the normal

    def in_words(self) -> dict[str, float]:
        """Return the push in mm and degrees."""
        angles = (self.angle, self.contact_angle, self.direction)
        degrees = (round(float(np.rad2deg(each)), 1) for each in angles)
        names = ("disk_angle_deg", "contact_normal_deg", "direction_deg")
        place = {"x_mm": round(1000 * self.x, 1), "y_mm": round(1000 * self.y, 1)}
        return {**place, **dict(zip(names, degrees, strict=True))}


def possible_pushes(
    fitted: Fitted, card: ProcessCard
) -> tuple[list[Proposal], Float[np.ndarray, "push input"]]:
    """Return pushes of one disk all over what the process was fitted to, and inputs.

    Raises:
        BadInput: the process is of two disks, whose arrangements no grid covers.
    """
    if card.disks > 1:
        raise BadInput(
            "`pool` is missing: pushes of two disks are proposed from a dataset of "
            "possible pushes."
        )
    seen = fitted.inputs * fitted.width + fitted.centre
    ranges = {
        name: (c.min(), c.max()) for name, c in zip(card.inputs, seen.T, strict=True)
    }
    draw = np.random.default_rng(_SEED).random((GRID, 5))
    turn = 2 * np.pi * (draw[:, :2] - 0.5)
    x, y, direction = (
        low + (high - low) * share
        for (low, high), share in zip(
            (
                ranges.get(name, (0.0, 0.0))
                for name in ("place_x", "place_y", "contact_angle")
            ),
            draw[:, 2:].T,
            strict=True,
        )
    )
    pushes = [
        Proposal(*map(float, row)) for row in zip(x, y, *turn.T, direction, strict=True)
    ]
    return pushes, np.array([_inputs(each, card, fitted) for each in pushes])


def propose(folder: Path, count: int, pool: Path | None) -> list[dict[str, float]]:
    """Return the next pushes to record, and the variance that each leaves.

    Args:
        folder: of the process.
        count: of the pushes.
        pool: dataset of possible pushes; None: pushes of one disk all over the range of
            those that the process was fitted to.

    Returns:
        For each push in order: its row in the pool; without one the place of the disk
        (mm), its angle, that of the contact normal on the table and that of the push
        from it (degrees); then the variance that is left (percent of that now).

    Raises:
        BadCheckpoint: the folder holds no process that can be used.
        BadInput: fewer pushes are possible, or the pool lacks an input.
    """
    fitted, card = read_process(folder)
    if pool is None:
        pushes, inputs = possible_pushes(fitted, card)
        rows = [each.in_words() for each in pushes]
    else:
        inputs = inputs_of(open_store(pool), card.inputs, card.disks, card.camera)
        rows = [{"row": row} for row in range(len(inputs))]
    if count > len(rows):
        raise BadInput(f"`count` is {count}; only {len(rows)} pushes are possible.")
    chosen, left = choose_pushes(fitted, inputs, count)
    return [
        {**rows[row], "variance_left_percent": round(100 * share, 1)}
        for row, share in zip(chosen.tolist(), left.tolist(), strict=True)
    ]


def _inputs(push: Proposal, card: ProcessCard, fitted: Fitted) -> list[float]:
    """Return the inputs of a push, with the mean mass and radius."""
    side = push.contact_angle - push.angle
    known = {"contact_angle": push.direction, "place_x": push.x, "place_y": push.y}
    for name, angle in (
        ("normal_on_disk", side),
        ("normal_on_table", push.contact_angle),
        ("disk_on_table", push.angle),
    ):
        known |= {f"{name}_x": np.cos(angle), f"{name}_y": np.sin(angle)}
    means = dict(zip(card.inputs, fitted.centre.tolist(), strict=True))
    return [float({**means, **known}[name]) for name in card.inputs]
