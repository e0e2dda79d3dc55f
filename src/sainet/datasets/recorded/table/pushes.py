"""Rows of a table put together to pushes; what cannot be is refused with its row."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from sainet.datasets.recorded.push import LONGEST, RecordedPush, Unusable, resample
from sainet.datasets.recorded.table.body_properties import BodyProperties
from sainet.datasets.recorded.table.rows import GROUP, NUMBERS, TableRows
from sainet.datasets.recorded.tracks import (
    ALLOWED_MOVE,
    ALLOWED_TURN,
    Track,
    distances,
    first_fall,
    first_jump,
)

_FAR = 5.0  # m
_MANY_TURNS = 20.0  # rad
_PLACES = ("x", "y", "pusher_x", "pusher_y")
_SAME_PLACE = 1e-6  # m
_DEEPEST = 0.005  # m, that two bodies may overlap by at the start
# The rim of a disk turns no further than what pushes it moves; in degrees it seems to
# turn 57 times as far.
_MOST_ROLLING, _ROLLING_SLACK = 3.0, 0.02  # of what was moved, and m


@dataclass(frozen=True)
class _Sequence:
    """The rows of one body in one push."""

    rows: Int[np.ndarray, " sample"]
    time: Float[np.ndarray, " sample"]  # s
    pose: Float[np.ndarray, "sample 3"]  # m, m, rad, unwrapped
    pusher: Float[np.ndarray, "sample 2"]  # m


def to_pushes(table: TableRows, properties: BodyProperties) -> list[RecordedPush]:
    """Return the pushes of a table in the order in which they first appear.

    Args:
        table: rows of different pushes and bodies in any order; those of one body in
            one push by rising time.
        properties: of the bodies that the table has, in their order, and no others.

    Raises:
        BadTable: with the row and the way out.
    """
    _check_units(table)
    pushes = []
    for code, sequences in _by_push(table, properties):
        name = f"push {table.names['push'][code][:40]!r}"
        _check_together(table, name, properties, sequences)
        for body, sequence in sequences.items():
            _check_motion(table, name, sequence, _radius(properties, body))
        _check_overlaps(table, name, properties, sequences)
        push = _push(table, name, list(sequences.values()))
        pushes.append(replace(push, name=f"{table.path}: {name}"))
    return pushes


def _radius(properties: BodyProperties, body: str) -> float:
    return properties.radius[properties.names.index(body)]


def _check_units(table: TableRows) -> None:
    for name in _PLACES:
        values = table.column(name)
        row = int(np.argmax(np.abs(values)))
        if abs(values[row]) > _FAR:
            value = f"{name} is {values[row]:g}"
            raise table.bad(
                row, f"{value}: looks like millimetres; places are in metres"
            )
    angle = table.column("angle")
    row = int(np.argmax(np.abs(angle)))
    if abs(angle[row]) > _MANY_TURNS:
        raise table.bad(
            row,
            f"angle is {angle[row]:g}: looks like degrees; angles are in radians, "
            "within three turns",
        )


def _by_push(
    table: TableRows, properties: BodyProperties
) -> Iterator[tuple[int, dict[str, _Sequence]]]:
    """Yield each push and the bodies that it has, in the order of the properties."""
    push, body = table.codes["push"], table.codes["body"]
    count = len(table.names["body"])
    key = push * count + body
    order = np.argsort(key, kind="stable")
    for rows in np.split(order, np.searchsorted(key[order], _starts(push, count))[1:]):
        kinds, where = body[rows], table.names["body"]
        found = {name: rows[kinds == where.index(name)] for name in properties.names}
        yield (
            int(push[rows[0]]),
            {name: _sequence(table, own) for name, own in found.items()},
        )


def _starts(push: np.ndarray, count: int) -> np.ndarray:
    """Return the smallest key that each push may have."""
    return np.arange(int(push.max()) + 1) * count


def _sequence(table: TableRows, rows: np.ndarray) -> _Sequence:
    values = table.values[rows]
    pose = values[:, [NUMBERS.index(name) for name in ("x", "y", "angle")]]
    pose[:, 2] = np.unwrap(pose[:, 2])
    pusher = values[:, [NUMBERS.index(name) for name in ("pusher_x", "pusher_y")]]
    return _Sequence(rows, values[:, NUMBERS.index("time")], pose, pusher)


def _check_together(
    table: TableRows,
    name: str,
    properties: BodyProperties,
    sequences: dict[str, _Sequence],
) -> None:
    """Check that all bodies are there, at the same times, with the same pusher."""
    present = [sequence for sequence in sequences.values() if len(sequence.rows)]
    first = present[0]
    for body, sequence in sequences.items():
        if not len(sequence.rows):
            raise table.bad(
                first.rows[0],
                f"{name}: body {body!r} is missing; all pushes of a file need the "
                "same bodies",
            )
        _check_clock(table, name, body, sequence)
        _check_same_times(table, name, body, (first, sequence))
        apart = np.abs(sequence.pusher - first.pusher).max(axis=1) > _SAME_PLACE
        if apart.any():
            row = sequence.rows[np.argmax(apart)]
            raise table.bad(
                row,
                f"{name}: the pusher is elsewhere than in the row of another body at "
                "the same time; repair one of them",
            )


def _check_clock(table: TableRows, name: str, body: str, sequence: _Sequence) -> None:
    time = sequence.time
    if len(time) < 2:  # noqa: PLR2004
        raise table.bad(
            sequence.rows[0],
            f"{name}: body {body!r} has one sample; a push needs at least two",
        )
    fall = first_fall(time)
    if fall is not None:
        same = time[fall] == time[fall - 1]
        wrong = "is there twice" if same else f"comes after {time[fall - 1]:.12g}"
        raise table.bad(
            sequence.rows[fall],
            f"{name}: body {body!r}: time {time[fall]:.12g} {wrong}; the times of a "
            "body in a push must rise: sort them, or remove the row",
        )
    if time[-1] - time[0] > LONGEST:
        raise table.bad(
            sequence.rows[-1],
            f"{name} lasts {time[-1] - time[0]:g}, at most {LONGEST:g} s are allowed: "
            "looks like milliseconds; times are in seconds",
        )


def _check_same_times(
    table: TableRows, name: str, body: str, pair: tuple[_Sequence, _Sequence]
) -> None:
    first, other = pair
    missing = ~np.isin(first.time, other.time)
    added = ~np.isin(other.time, first.time)
    if missing.any():
        row, time = first.rows[np.argmax(missing)], first.time[np.argmax(missing)]
        raise table.bad(row, f"{name}: body {body!r} is missing at time {time:.12g}")
    if added.any():
        row, time = other.rows[np.argmax(added)], other.time[np.argmax(added)]
        raise table.bad(row, f"{name}: another body is missing at time {time:.12g}")


def _check_motion(
    table: TableRows, name: str, sequence: _Sequence, radius: float
) -> None:
    x, y, turn = np.ptp(sequence.pose, axis=0)
    way = np.hypot(x, y) + np.hypot(*np.ptp(sequence.pusher, axis=0))
    if turn * radius > _MOST_ROLLING * way + _ROLLING_SLACK:
        raise table.bad(
            sequence.rows[0],
            f"{name}: the angle changes by {turn:.3g} while all moves by {way:.3g} m: "
            "looks like degrees; angles are in radians",
        )
    moves = {
        "the body": (distances(sequence.pose[:, :2]), ALLOWED_MOVE),
        "the pusher": (distances(sequence.pusher), ALLOWED_MOVE),
        "the angle": (np.abs(np.diff(sequence.pose[:, 2])), ALLOWED_TURN),
    }
    for what, (moved, allowed) in moves.items():
        jump = first_jump(sequence.time, moved, allowed)
        if jump is not None:
            raise table.bad(
                sequence.rows[jump],
                f"{name}: {what} jumps from the sample before; repair it, or leave "
                "the push out",
            )


def _check_overlaps(
    table: TableRows,
    name: str,
    properties: BodyProperties,
    sequences: dict[str, _Sequence],
) -> None:
    starts = {body: sequence.pose[0, :2] for body, sequence in sequences.items()}
    circles = [(repr(b), at, _radius(properties, b)) for b, at in starts.items()]
    first = next(iter(sequences.values()))
    circles.append(("the pusher", first.pusher[0], properties.pusher_radius))
    for index, (one, place, radius) in enumerate(circles):
        for other, there, reach in circles[index + 1 :]:
            depth = radius + reach - np.linalg.norm(place - there)
            if depth > _DEEPEST:
                raise table.bad(
                    first.rows[0],
                    f"{name}: {one} and {other} overlap by {1000 * depth:.1f} mm at "
                    "the start; check their radii",
                )


def _push(table: TableRows, name: str, sequences: list[_Sequence]) -> RecordedPush:
    first = sequences[0]
    poses = np.concatenate([sequence.pose for sequence in sequences], axis=1)
    bodies, pusher = Track(first.time, poses), Track(first.time, first.pusher)
    try:
        return resample(bodies, pusher, _group(table, name, sequences))
    except Unusable as reason:
        raise table.bad(first.rows[0], f"{name} {reason}") from None


def _group(table: TableRows, name: str, sequences: list[_Sequence]) -> str:
    if GROUP not in table.codes:
        return ""
    rows = np.concatenate([sequence.rows for sequence in sequences])
    codes = table.codes[GROUP][rows]
    other = codes != codes[0]
    if other.any():
        raise table.bad(
            rows[np.argmax(other)], f"{name} is in several groups; name one"
        )
    return table.names[GROUP][codes[0]]
