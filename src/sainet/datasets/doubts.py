"""Doubtful recordings: stored pushes that geometry or mechanics contradict.

Import refuses pushes that no table can hold; the bounds here are narrower, and a push
beyond them may still be right. In the tests no simulated push is beyond one.
"""

from collections.abc import Iterator

import msgspec
import numpy as np
from jaxtyping import Bool

from sainet.datasets.facts import Facts
from sainet.datasets.store import Store
from sainet.scenes.scene import GRAVITY

START_OVERLAP = 0.002  # m
OVERLAP = 0.005  # m, also of a path and a disk that stays in it
NEAR = 0.005  # m: a pusher farther away moves no disk
STILL = 0.002  # m
SLACK = 0.003  # m, of the bounds on travel and rotation
_LEAST_FRICTION = 0.05
_TEXTS = {
    "duplicate": "starts and is commanded as push {}; keep one of them",
    "no known pose": "no pose after the start is known; no model can learn from it",
    "unknown final pose": "the pusher moves by {:.1f} mm after the last known pose; "
    "record all of it",
    "pusher at rest": "the pusher moves by {:.1f} mm; leave it out",
    "overlap at the start": "two bodies overlap by {:.1f} mm at the start; check "
    "places and radii",
    "overlap": "two bodies overlap by {:.1f} mm; check places, radii and clocks",
    "pushed through": "the pusher goes {:.1f} mm deeper into the place of a disk than "
    "the disk moves; check places and radii",
    "moved untouched": "a disk moves by {:.1f} mm, the pusher stays {:.1f} mm away "
    "from every disk; check places and radii",
    "missed": "the pusher passes every disk at {:.1f} mm; check places or leave it out",
    "moved too far": "a disk moves by {:.1f} mm, the pusher by {:.1f} mm; check poses "
    "and names",
    "turned too far": "a rim turns by {:.1f} mm, pusher and disks move by {:.1f} mm; "
    "check angles",
    "turned the other way": "a disk turns by {:.1f} degrees, against its push like "
    "most disks; check the signs of x, y and the angles (counter-clockwise)",
}
_Rule = tuple[str, Bool[np.ndarray, " push"], tuple[np.ndarray, ...]]


class Doubt(msgspec.Struct, frozen=True, kw_only=True):
    """Reason why a stored push may be recorded wrongly."""

    row: int  # of the dataset, from 0
    group: str  # empty: none
    reason: str  # equal for equal doubts of different pushes
    text: str  # with values and remedy


def find_doubts(store: Store, facts: Facts) -> list[Doubt]:
    """Return the doubts about the pushes of a store, by row.

    Args:
        store: of the pushes.
        facts: of all of them, by `facts_of`.
    """
    found: list[Doubt] = []
    for reason, holds, values in _rules(store, facts):
        for row in np.flatnonzero(holds):
            text = _TEXTS[reason].format(*(each[row] for each in values))
            group = store.info.groups[facts.group[row]] if store.info.groups else ""
            found.append(Doubt(row=int(row), group=group, reason=reason, text=text))
    return sorted(found, key=lambda doubt: doubt.row)


def _rules(store: Store, facts: Facts) -> Iterator[_Rule]:
    """Yield each reason, whether it holds for each push, and the values of its text."""
    first = store.first_alike()
    yield "duplicate", first < np.arange(len(first)), (first,)
    unknown, unseen = facts.known_steps == 0, facts.unseen
    yield "no known pose", unknown, ()
    yield "unknown final pose", ~unknown & (unseen > STILL), (1e3 * unseen,)
    yield "pusher at rest", facts.stroke < STILL, (1e3 * facts.stroke,)
    yield from _of_contact(facts)
    yield from _of_motion(facts)


def _of_contact(facts: Facts) -> Iterator[_Rule]:
    gap, moved = facts.gap.min(axis=1), facts.moved.max(axis=1)
    start, later = facts.start_overlap, facts.overlap
    yield "overlap at the start", start > START_OVERLAP, (1e3 * start,)
    yield "overlap", later > OVERLAP, (1e3 * later,)
    # A disk leaves the places that the pusher takes.
    through = (-facts.gap - facts.moved).max(axis=1)
    yield "pushed through", through > OVERLAP, (1e3 * through,)
    is_away = gap > NEAR
    yield "moved untouched", is_away & (moved > STILL), (1e3 * moved, 1e3 * gap)
    yield "missed", is_away & (moved <= STILL), (1e3 * gap,)


def _of_motion(facts: Facts) -> Iterator[_Rule]:
    """Yield bounds on travel and rotation.

    A collision at most doubles the speed v of the pusher, then a disk slides by
    (2 v)^2 / (2 mu g). A rim moves at most as far as what drives it: friction ends
    where it no longer slips.
    """
    friction = np.maximum(facts.table_friction, _LEAST_FRICTION)
    most = facts.path_length + (2 * facts.top_speed) ** 2 / (2 * friction * GRAVITY)
    moved = facts.moved.max(axis=1)
    values = 1e3 * moved, 1e3 * facts.path_length
    yield "moved too far", moved > most + SLACK, values
    rim = (facts.turned * facts.radius).max(axis=1)
    driven = moved * (2 * facts.moved.shape[1] - 1)  # disks drive disks
    values = 1e3 * rim, 1e3 * (facts.path_length + moved)
    yield "turned too far", rim > most + driven + SLACK, values
    yield from _of_sense(facts)


def _of_sense(facts: Facts) -> Iterator[_Rule]:
    """Yield pushes that turn a disk against the side on which the pusher passes it.

    A disk that touches others may do so. If most disks do, an axis is reversed.
    """
    far = np.linalg.norm(facts.start[..., :2] - facts.path[:, :1], axis=-1)
    pushed = np.arange(len(far)), np.argmin(far - facts.radius, axis=1)
    turned = (facts.end - facts.start)[..., 2][pushed]
    side = far[pushed] * np.sin(facts.direction)  # of the path, from the centre
    clear = (np.abs(turned) * facts.radius[pushed] > SLACK) & (np.abs(side) > NEAR)
    against = clear & (turned * side > 0)
    are_most = against.sum() > 3 * max(1, (clear & ~against).sum())
    yield "turned the other way", against & are_most, (np.rad2deg(turned),)
