"""A table of own recorded pushes: one row for each push, time and body."""

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from sainet.datasets.recorded import checks, tables
from sainet.datasets.recorded.importing import import_pushes
from sainet.datasets.recorded.problems import Problems
from sainet.datasets.recorded.properties import Properties, read_properties
from sainet.datasets.recorded.resample import resample
from sainet.datasets.recorded.units import Units
from sainet.datasets.store import Store
from sainet.runs.documents import content_hash
from sainet.scenes.recording import Conditions, Recording

_log = logging.getLogger(__name__)
_PLACES = ("x", "y", "pusher_x", "pusher_y")
_PLACE = replace(checks.PLACE, remedy="in another unit, give `length_unit`")
_ANGLE = replace(checks.ANGLE, remedy="in another unit, give `angle_unit`")
_SAME_PLACE = 1e-6  # m
COLUMNS = tables.Columns(
    texts=("push", "body"),
    optional=("group", "kind"),
    numbers=("time", "x", "y", "angle", "pusher_x", "pusher_y"),
    note=" Columns: push, body, time (s), x, y, pusher_x, pusher_y (m), angle (rad), "
    "optionally group and kind.",
)


def import_table(
    path: Path,
    properties: Path,
    out: Path,
    *,
    contact_friction: float | None = None,
    units: Units | None = None,
    skip_bad: bool = False,
) -> Store:
    """Make a store of a table with one row for each push, time and body.

    Args:
        path: a .csv or .parquet file; `docs/importing.md` describes its columns.
        properties: TOML file of masses, radii and frictions.
        out: run folder.
        contact_friction: of two bodies, and of pusher and body; replaces the value of
            the properties.
        units: of the table; None: m, rad and s. Messages are in m, rad and s.
        skip_bad: leave out pushes with a problem, and log how many and why.

    Raises:
        BadTable: with file, row (line of the file, from 1), field and remedy; one
            problem a line, at most 20.
        BadSetting: the friction is out of range.
        MissingExtra: the table is Parquet, and pyarrow is not installed.
        RunConflict: the folder holds something else.
        BadInput: the disk is full.
    """
    path, problems = Path(path), Problems()
    data = tables.read_bytes(path, ".csv", ".parquet")
    units = units or Units()
    table = units.to_si(_read(path, data, problems))
    known = read_properties(Path(properties), contact_friction, problems)
    bodies = _present(table, known, Path(properties), problems)
    recordings = list(_recordings(table, bodies, problems)) if bodies else []
    good = len(recordings)
    problems.raise_any(skip_bad=skip_bad and good > 0, good=good)
    assert bodies is not None
    settings = {"command": "import table", "source": path.name}
    settings |= {"source_sha256": content_hash(data)} | units.settings
    if skip_bad:
        count = len(table.texts["push"].names)
        settings |= {"skip_bad": True, "left_out": count - good}
        problems.warn(path, count - good, count)
    return import_pushes(out, settings, [*map(resample, recordings)], bodies)


def _read(path: Path, data: bytes, problems: Problems) -> tables.Table:
    if path.suffix.lower() == ".parquet":
        from sainet.datasets.recorded.binary import read_parquet

        return read_parquet(path, data, COLUMNS, problems)
    return tables.read_csv(path, data, COLUMNS, problems)


def _present(
    table: tables.Table, known: Properties, path: Path, problems: Problems
) -> Properties | None:
    """Return the properties of the bodies of the table, None if some have none."""
    if "body" not in table.texts or not known.bodies:
        return None
    body = table.texts["body"]
    for code, name in enumerate(body.names):
        if name and name not in known.bodies:
            row = int(np.argmax(body.code == code))
            problems.add(
                "unknown body",
                f"{table.where(row)}: body {name[: tables.SHOWN]!r} has no properties; "
                f"add [bodies.NAME] to {path}.",
            )
    if not set(body.names) <= {*known.bodies, ""}:
        return None
    kept = [index for index, name in enumerate(known.bodies) if name in body.names]
    for name in sorted(set(known.bodies) - set(body.names)):
        _log.warning("%s: body %r is in no push of %s", path, name, table.path)
    return replace(
        known,
        bodies=tuple(known.bodies[index] for index in kept),
        mass=tuple(known.mass[index] for index in kept),
        radius=tuple(known.radius[index] for index in kept),
    )


def _recordings(
    table: tables.Table, properties: Properties, problems: Problems
) -> Iterator[Recording]:
    """Yield the pushes of a table in the order in which they first appear.

    Rows of different pushes and bodies may be in any order; times of one body in one
    push must rise. Pushes with a problem are left out.
    """
    table.check(problems, _PLACE, *_PLACES)
    table.check(problems, _ANGLE, "angle")
    if not table.is_whole:
        return  # further checks would repeat the problems of the header and rows
    for push in _by_push(table, properties):
        recording = push.to_recording(problems) if push.is_sound(problems) else None
        if recording is None:
            continue
        found = checks.clock_problems(recording)
        if push.is_in_range:
            found = checks.recording_problems(recording, properties)
        problem = next(found, None)  # later problems may follow from the first
        if problem:
            row = push.rows[problem.body][problem.sample]
            line = f"{table.where(row)}: {push.name}: {problem.text}."
            problems.add(problem.kind, line, of_push=True)
        elif push.is_in_range:
            yield recording


def _by_push(table: tables.Table, properties: Properties) -> Iterator["_Push"]:
    push, body = table.texts["push"], table.texts["body"]
    order = np.argsort(push.code, kind="stable")
    first = np.searchsorted(push.code[order], np.arange(len(push.names)))
    lacks_value = table.lacks_value
    for code, rows in enumerate(np.split(order, first[1:])):
        if lacks_value[rows].any():
            continue  # which is a problem already
        own = [rows[body.code[rows] == body.names.index(n)] for n in properties.bodies]
        name = f"push {push.names[code][: tables.SHOWN]!r}"
        yield _Push(table, name, properties.bodies, own)


@dataclass(frozen=True)
class _Push:
    """Rows of one push."""

    table: tables.Table
    name: str
    bodies: tuple[str, ...]
    rows: list[Int[np.ndarray, " _"]]  # of each body

    def columns(self, body: int, *names: str) -> Float[np.ndarray, "sample _"]:
        numbers, rows = self.table.numbers, self.rows[body]
        return np.column_stack([numbers[name][rows] for name in names])

    def time(self, body: int) -> Float[np.ndarray, " sample"]:
        return self.columns(body, "time")[:, 0]

    def pusher(self, body: int) -> Float[np.ndarray, "sample 2"]:
        return self.columns(body, "pusher_x", "pusher_y")

    @property
    def is_in_range(self) -> bool:
        """Whether all places and angles are in range; else a unit is mistaken."""
        most = dict.fromkeys(_PLACES, checks.PLACE.high) | {"angle": checks.ANGLE.high}
        known = [self.columns(body, *most) for body in self._indices]
        return bool((np.abs(np.concatenate(known)) <= [*most.values()]).all())

    def is_sound(self, problems: Problems) -> bool:
        """Return whether all bodies have the same rising times and the same pusher."""
        first = next(body for body in self._indices if len(self.rows[body]))
        for body in self._indices:
            found = self._problem(first, body)
            if found:
                kind, row, text = found
                line = f"{self.table.where(row)}: {self.name}: {text}."
                problems.add(kind, line, of_push=True)
                return False
        return True

    @property
    def _indices(self) -> range:
        return range(len(self.bodies))

    def _problem(self, first: int, body: int) -> tuple[str, np.integer, str] | None:
        """Return kind, row and text of the first problem of a body's rows, if any.

        Args:
            first: body to which its times and its pusher are compared.
            body: index of the body.
        """
        rows, named = self.rows[body], f"body {self.bodies[body]!r}"
        if not len(rows):
            text = f"{named} is missing; all pushes of a file need the same bodies"
            return "missing body", self.rows[first][0], text
        time, wanted = self.time(body), self.time(first)
        fall = checks.first_fall(time)
        if fall is not None:
            same = time[fall] == time[fall - 1]
            wrong = "appears twice" if same else f"comes after {time[fall - 1]:.12g}"
            text = f"{named}: time {time[fall]:.12g} {wrong}; sort the times, remove "
            return "clock", rows[fall], text + "the row, or give each push its own name"
        here = ~np.isin(wanted, time), named, first
        there = ~np.isin(time, wanted), "another body", body
        for missing, who, of in (here, there):
            if missing.any():
                at = int(np.argmax(missing))
                text = f"{who} is missing at time {self.time(of)[at]:.12g}; add its "
                text += "row, or remove all rows of that time"
                return "missing time", self.rows[of][at], text
        apart = np.abs(self.pusher(body) - self.pusher(first)).max(axis=1)
        if (apart > _SAME_PLACE).any():
            text = "the pusher is elsewhere than in the row of another body at the same"
            row = rows[np.argmax(apart > _SAME_PLACE)]
            return "pusher", row, f"{text} time; repair one of them"
        return None

    def to_recording(self, problems: Problems) -> Recording | None:
        """Return the recording; None after adding a problem of its group or kind."""
        labels = {"group": "", "kind": ""}
        rows = np.concatenate(self.rows)
        for column in filter(self.table.texts.__contains__, [*labels]):
            text = self.table.texts[column]
            other = text.code[rows] != text.code[rows[0]]
            if other.any():
                line = self.table.where(rows[np.argmax(other)])
                line = f"{line}: {self.name} is in several {column}s; use one."
                problems.add(column, line, of_push=True)
                return None
            labels[column] = text.names[text.code[rows[0]]]
        poses = [self.columns(body, "x", "y", "angle") for body in self._indices]
        pose = np.stack(poses, axis=1)
        pose[..., 2] = np.unwrap(pose[..., 2], axis=0)
        # A push has the same hash whatever the turn that its angles are counted in.
        pose[..., 2] -= 2 * np.pi * np.rint(pose[0, :, 2] / (2 * np.pi))
        return Recording(
            time=self.time(0),
            pose=pose,
            pusher=self.pusher(0),
            conditions=Conditions(surface=labels["group"]),
            source=f"{self.table.path}: {self.name}",
            plan=labels["kind"] and f"{labels['group']}/{labels['kind']}",
        )
