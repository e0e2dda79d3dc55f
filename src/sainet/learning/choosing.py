"""Which push to record next: the one that reduces the variance of predictions most.

The criterion is that of Cohn, Ghahramani and Jordan (1996), "Active learning with
statistical models": the variance of a Gaussian process depends on its inputs alone, so
that its expected reduction over all possible pushes is known before a push is made.
"""

from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import cho_solve, cholesky

from sainet.datasets.store import open_store
from sainet.learning.process_ends import inputs_of
from sainet.models.fitted_process import Fitted, covariance_between, read_process
from sainet.models.process_card import ProcessCard
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


class Proposal(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A push to record next: a row of a pool, or a push of one disk."""

    row: int | None = None  # of the pool
    # Place of the disk on the table; None: the process does not depend on it.
    x_mm: float | None = None
    y_mm: float | None = None
    # Angle of the disk and contact normal, both on the table; None as above.
    disk_angle_deg: float | None = None
    contact_normal_deg: float | None = None
    direction_deg: float | None = None  # of the push, from the normal
    variance_left_percent: float  # after this push and those before it


@dataclass(frozen=True)
class _Push:
    """A push of one disk that could be made."""

    x: float  # m, of the disk on the table
    y: float  # m
    angle: float  # rad, of the disk
    normal: float  # rad, of the contact on the table
    direction: float  # rad, of the push from the normal

    def inputs(self, card: ProcessCard, fitted: Fitted) -> list[float]:
        """Return the inputs of the push, with the mean mass and radius."""
        known = {"contact_angle": self.direction, "place_x": self.x, "place_y": self.y}
        for name, angle in (
            ("normal_on_disk", self.normal - self.angle),
            ("normal_on_table", self.normal),
            ("disk_on_table", self.angle),
        ):
            known |= {f"{name}_x": np.cos(angle), f"{name}_y": np.sin(angle)}
        means = dict(zip(card.inputs, fitted.centre.tolist(), strict=True))
        return [float({**means, **known}[name]) for name in card.inputs]

    def proposed(self, card: ProcessCard, left: float) -> Proposal:
        """Return the push without what the process does not depend on."""
        degrees = np.rad2deg([self.angle, self.normal, self.direction])
        angle, normal, direction = degrees.round(1).tolist()
        has_place, has_side = (
            name in card.inputs for name in ("place_x", "normal_on_disk_x")
        )
        return Proposal(
            x_mm=round(1000 * self.x, 1) if has_place else None,
            y_mm=round(1000 * self.y, 1) if has_place else None,
            disk_angle_deg=angle if has_side else None,
            contact_normal_deg=normal if has_side else None,
            direction_deg=direction,
            variance_left_percent=left,
        )


def _possible_pushes(fitted: Fitted, card: ProcessCard) -> list[_Push]:
    """Return pushes of one disk all over what the process was fitted to.

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
        name: (values.min(), values.max())
        for name, values in zip(card.inputs, seen.T, strict=True)
    }
    draw = np.random.default_rng(_SEED).random((GRID, 5))
    turn = 2 * np.pi * (draw[:, :2] - 0.5)
    names = ("place_x", "place_y", "contact_angle")
    x, y, direction = (
        low + (high - low) * share
        for (low, high), share in zip(
            (ranges.get(name, (0.0, 0.0)) for name in names), draw[:, 2:].T, strict=True
        )
    )
    columns = (x, y, *turn.T, direction)
    return [_Push(*map(float, row)) for row in zip(*columns, strict=True)]


def propose(folder: Path, count: int, pool: Path | None) -> list[Proposal]:
    """Return the next pushes to record, in order.

    Args:
        folder: of the process.
        count: of the pushes.
        pool: dataset of possible pushes; None: pushes of one disk all over the range of
            those that the process was fitted to.

    Raises:
        BadCheckpoint: the folder contains no process that can be used.
        BadStore: the pool cannot be used.
        BadInput: fewer pushes are possible, or a process of two disks has no pool.
    """
    fitted, card = read_process(folder)
    pushes = _possible_pushes(fitted, card) if pool is None else []
    if pool is None:
        inputs = np.array([push.inputs(card, fitted) for push in pushes])
    else:
        inputs = inputs_of(open_store(pool), card.inputs, card.disks, card.camera)
    if count > len(inputs):
        raise BadInput(f"`count` is {count}; only {len(inputs)} pushes are possible.")
    rows, left = choose_pushes(fitted, inputs, count)
    return [
        pushes[row].proposed(card, share)
        if pushes
        else Proposal(row=row, variance_left_percent=share)
        for row, share in zip(
            rows.tolist(), (100 * left).round(1).tolist(), strict=True
        )
    ]
