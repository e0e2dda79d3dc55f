"""Checks of recorded pushes, the same for every file format."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from sainet.datasets.recorded.properties import Properties
from sainet.datasets.recorded.resample import Track, common_span, tracks_of
from sainet.datasets.recorded.tables import SHOWN
from sainet.scenes.quantities import Quantity
from sainet.scenes.recording import Recording
from sainet.scenes.scene import GRAVITY, TIME_STEP

# Narrower than what a scene may have: beyond them units are mistaken.
PLACE = Quantity("place", "m", -5.0, 5.0, "millimetres")
ANGLE = Quantity("angle", "rad", -20.0, 20.0, "degrees")
LONGEST = 60.0  # s
_MOVE = 0.005  # m, between samples of 250 Hz: 1.25 m/s
_TURN = np.deg2rad(10)  # rad, between samples of 250 Hz: 44 rad/s
_SPACING = 1 / 250  # s
_DEEPEST = 0.005  # m of overlap at the start
_NEAREST = 0.02  # m: a pusher farther away moves no disk
_STILL = 0.002  # m
# The rim of a disk moves no further than the pusher or the disk that drives it; angles
# in degrees make this motion 57 times larger. A pushed disk moves as far as the pusher,
# and then slides.
_MOST, _SLACK = 3.0, 0.02  # of the travel, and m
_LOWEST_FRICTION = 0.05


@dataclass(frozen=True)
class Problem:
    """Reason why a recording cannot be used."""

    kind: str  # equal for equal problems of different pushes
    text: str  # with values and remedy, without a full stop
    sample: int = 0  # at which it occurs
    body: int = 0


def recording_problems(
    recording: Recording, properties: Properties
) -> Iterator[Problem]:
    """Yield the problems of a recording; the later ones may follow from the first.

    Args:
        recording: angles unwrapped.
        properties: of its disks and pusher, in the same order.
    """
    yield from clock_problems(recording)
    *bodies, pusher = tracks_of(recording)
    for find in (_units, _degrees, _jumps, _overlaps, _travel, _touch):
        yield from find(bodies, pusher, properties)


def clock_problems(recording: Recording) -> Iterator[Problem]:
    """Yield the problems of the number of samples and of the duration."""
    tracks = tracks_of(recording)
    few = [len(track.time) < 2 for track in tracks]  # noqa: PLR2004
    if any(few):
        text = "has fewer than two samples; a push needs at least two"
        body = min(few.index(True), recording.bodies - 1)
        yield Problem("fewer than two samples", text, body=body)
        return
    _, duration = common_span(tracks)
    if duration > LONGEST:
        yield Problem(
            "lasts over 60 s",
            f"lasts {duration:g} s (in milliseconds?); at most {LONGEST:g} s are "
            "allowed: give times in seconds, or `time_unit`",
            sample=len(recording.time) - 1,
        )
    elif round(duration / TIME_STEP) < 1:
        text = "lasts less than a step of 1/240 s, or its clocks share no time"
        yield Problem("lasts less than a step, or its clocks share no time", text)


def first_fall(time: Float[np.ndarray, " sample"]) -> int | None:
    """Return the first sample that is not later than the one before it, if any."""
    return _first(np.diff(time) <= 0)


def _first(wrong: Bool[np.ndarray, " step"]) -> int | None:
    found: Int[np.ndarray, " wrong"] = np.flatnonzero(wrong)
    return int(found[0]) + 1 if len(found) else None


def _units(
    bodies: list[Track], pusher: Track, properties: Properties
) -> Iterator[Problem]:
    named = zip((*_disks(properties), "the pusher"), (*bodies, pusher), strict=True)
    for body, (name, track) in enumerate(named):
        checks = [("place", PLACE, track.value[:, :2])]
        checks += [("angle", ANGLE, track.value[:, 2])] if body < len(bodies) else []
        for what, quantity, values in checks:
            worst = float(values.flat[np.argmax(np.abs(values))])
            if not quantity.accepts(worst):
                yield Problem(
                    f"the {what} is out of range",
                    f"the {what} of {name} is {worst:g} {quantity.unit} (in "
                    f"{quantity.mistaken_for}?); it must be {quantity.wanted}",
                    body=min(body, len(bodies) - 1),
                )


def _degrees(
    bodies: list[Track], pusher: Track, properties: Properties
) -> Iterator[Problem]:
    for body, track in enumerate(bodies):
        turn = float(np.ptp(track.value[:, 2]))
        way = _extent(track) + _extent(pusher)
        if turn * properties.radius[body] > _MOST * way + _SLACK:
            yield Problem(
                "an angle changes too much",
                f"the angle changes by {turn:.3g} rad while disk and pusher together "
                f"move by {way:.3g} m (in degrees?); give angles in radians, or "
                "`angle_unit`",
                body=body,
            )


def _extent(track: Track) -> float:
    """Return the diagonal (m) of the rectangle that a path lies in."""
    return float(np.hypot(*np.ptp(track.value[:, :2], axis=0)))


def _jumps(
    bodies: list[Track], pusher: Track, properties: Properties
) -> Iterator[Problem]:
    for body, track in enumerate((*bodies, pusher)):
        what = "the body" if body < len(bodies) else "the pusher"
        of = min(body, len(bodies) - 1)
        yield from _jump(track.time, distances(track), _MOVE, (what, of, "m"))
    for body, track in enumerate(bodies):
        turned = np.abs(np.diff(track.value[:, 2]))
        yield from _jump(track.time, turned, _TURN, ("the angle", body, "rad"))


def distances(track: Track) -> Float[np.ndarray, " step"]:
    """Return the distance (m) of each sample but the first from the one before."""
    return np.linalg.norm(np.diff(track.value[:, :2], axis=0), axis=1)


def _jump(
    time: Float[np.ndarray, " sample"],
    moved: Float[np.ndarray, " step"],
    allowed: float,
    of: tuple[str, int, str],
) -> Iterator[Problem]:
    """Yield the first jump, if any; samples further apart than 4 ms may move more."""
    if jump := _first(moved > allowed * np.maximum(np.diff(time) / _SPACING, 1)):
        what, body, unit = of
        by = f"{moved[jump - 1]:.3g} {unit} in {time[jump] - time[jump - 1]:.3g} s"
        text = f"{what} jumps by {by}; repair it or remove the push"
        yield Problem(f"{what} jumps", text, sample=jump, body=body)


def _overlaps(
    bodies: list[Track], pusher: Track, properties: Properties
) -> Iterator[Problem]:
    start, _ = common_span([*bodies, pusher])
    places = [track.at(np.array([start]))[0, :2] for track in (*bodies, pusher)]
    radii = (*properties.radius, properties.pusher_radius)
    circles = list(zip((*_disks(properties), "the pusher"), places, radii, strict=True))
    for index, (one, place, radius) in enumerate(circles):
        for other, there, reach in circles[index + 1 :]:
            depth = radius + reach - float(np.linalg.norm(place - there))
            if depth > _DEEPEST:
                yield Problem(
                    "an overlap at the start",
                    f"{one} and {other} overlap by {1000 * depth:.1f} mm at the start; "
                    "check places and radii",
                )


def _disks(properties: Properties) -> list[str]:
    return [repr(name[:SHOWN]) for name in properties.bodies]


def _travel(
    bodies: list[Track], pusher: Track, properties: Properties
) -> Iterator[Problem]:
    """Yield a disk that moves further than any push at that speed can send it.

    A collision at most doubles the speed v of the pusher; then the disk slides by
    (2 v)^2 / (2 mu g).
    """
    speed = float(np.max(distances(pusher) / np.diff(pusher.time)))
    sliding = (2 * speed) ** 2 / (2 * _LOWEST_FRICTION * GRAVITY)
    way = _extent(pusher)
    for body, track in enumerate(bodies):
        moved = _extent(track)
        if moved > _MOST * way + _SLACK + sliding:
            yield Problem(
                "a disk moves too far",
                f"{_disks(properties)[body]} moves by {1000 * moved:.0f} mm while the "
                f"pusher moves by {1000 * way:.0f} mm; check their places",
                body=body,
            )


def _touch(
    bodies: list[Track], pusher: Track, properties: Properties
) -> Iterator[Problem]:
    """Yield a disk that moves although the pusher stays away from all disks."""
    moved = [_extent(track) for track in bodies]
    gaps = [
        np.linalg.norm(pusher.value - track.at(pusher.time)[:, :2], axis=1) - radius
        for track, radius in zip(bodies, properties.radius, strict=True)
    ]
    gap = float(np.min(gaps)) - properties.pusher_radius
    if max(moved) > _STILL and gap > _NEAREST:
        yield Problem(
            "a disk moves untouched",
            f"{_disks(properties)[int(np.argmax(moved))]} moves by "
            f"{1000 * max(moved):.0f} mm while the pusher stays {1000 * gap:.0f} mm "
            "away from every disk; check places and radii",
        )
