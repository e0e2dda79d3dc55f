"""Disks, pusher and frictions of recorded pushes: from a TOML file, or known."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sainet.datasets.recorded.problems import Problems
from sainet.datasets.recorded.tables import SHOWN
from sainet.datasets.schema import Arrays
from sainet.runs.documents import read_file
from sainet.runs.errors import BadTable
from sainet.scenes.quantities import FRICTION, MASS, PUSHER_RADIUS, RADIUS, Quantity

CONTACT_FRICTION = 0.25
TABLE_FRICTION = 0.15  # the paper's; a quasi-static path hardly depends on it
_EXAMPLE = (
    "[bodies.NAME] with mass = 0.9 and radius = 0.05, and [pusher] radius = 0.005"
)
_LARGEST = 1 << 20  # bytes
_BODY = {"mass": MASS, "radius": RADIUS}
_PUSHER = {"radius": PUSHER_RADIUS}
_FRICTION = {"table": FRICTION, "contact": FRICTION}


@dataclass(frozen=True, kw_only=True)
class Properties:
    """Scene properties that all pushes of a store share."""

    bodies: tuple[str, ...]  # names, in the order of the store
    mass: tuple[float, ...]  # kg
    radius: tuple[float, ...]  # m
    pusher_radius: float  # m
    contact_friction: float = CONTACT_FRICTION  # of two disks, and pusher and disk
    table_friction: float = TABLE_FRICTION

    def arrays(self, pushes: int) -> Arrays:
        """Return the properties as arrays of a store."""
        every, rows = np.ones(pushes), np.ones((pushes, 1))
        return {
            "mass": rows * np.array(self.mass)[None],
            "radius": rows * np.array(self.radius)[None],
            "table_friction": every * self.table_friction,
            "disk_friction": every * self.contact_friction,
            "pusher_friction": every * self.contact_friction,
            "pusher_radius": every * self.pusher_radius,
        }


MITPUSH_DISK = "ellip1"


def mitpush_properties(contact_friction: float, table_friction: float) -> Properties:
    """Return the properties of the disk of the MIT Push dataset.

    Raises:
        BadSetting: a friction is out of range.
    """
    frictions = {"contact_friction": contact_friction, "table_friction": table_friction}
    for name, value in frictions.items():
        FRICTION.require(name, value)
    return Properties(
        bodies=(MITPUSH_DISK,),
        mass=(0.8937,),
        radius=(0.0525,),
        pusher_radius=0.00475,
        contact_friction=float(contact_friction),
        table_friction=float(table_friction),
    )


def read_properties(
    path: Path, contact_friction: float | None, problems: Problems
) -> Properties:
    """Read masses, radii and frictions; values with a problem become NaN.

    Args:
        path: TOML file with `[bodies.NAME] mass, radius`, `[pusher] radius` and
            optionally `[friction] table, contact`.
        contact_friction: replaces the value of the file; None keeps it.
        problems: to which problems of the file are added.

    Raises:
        BadTable: the file cannot be read or is not TOML.
        BadSetting: the contact friction is out of range.
    """
    if contact_friction is not None:
        FRICTION.require("contact_friction", contact_friction)
    reader = _Reader(path, problems)
    content = _load(path)
    reader.only("the file", content, ("bodies", "pusher", "friction"))
    names = reader.section(content, "bodies") or {}
    bodies = [reader.values(f"[bodies.{_short(n)}]", names[n], _BODY) for n in names]
    pusher = reader.values("[pusher]", reader.section(content, "pusher"), _PUSHER)
    defaults = {"table": TABLE_FRICTION, "contact": CONTACT_FRICTION}
    given = reader.section(content, "friction") if "friction" in content else {}
    friction = reader.values("[friction]", given, _FRICTION, defaults)
    contact = friction["contact"] if contact_friction is None else contact_friction
    return Properties(
        bodies=tuple(names),
        mass=tuple(body["mass"] for body in bodies),
        radius=tuple(body["radius"] for body in bodies),
        pusher_radius=pusher["radius"],
        table_friction=friction["table"],
        contact_friction=float(contact),
    )


def _load(path: Path) -> dict[str, object]:
    try:
        return tomllib.loads(read_file(path, most=_LARGEST, error=BadTable).decode())
    except (ValueError, RecursionError) as error:
        reason = str(error).partition("\n")[0][:100]
        raise BadTable(f"{path}: not TOML ({reason}); write {_EXAMPLE}.") from None


def _short(value: object) -> str:
    return f"{value!r}"[:SHOWN]


@dataclass(frozen=True)
class _Reader:
    """Reads sections and values; adds what cannot be used to the problems."""

    path: Path
    problems: Problems

    def bad(self, kind: str, problem: str) -> None:
        self.problems.add(f"properties {kind}", f"{self.path}: {problem}")

    def only(
        self, where: str, content: Mapping[str, object], known: tuple[str, ...]
    ) -> None:
        for name in content:
            if name not in known:
                choices = ", ".join(known)
                problem = f"{where} has an unknown field {_short(name)}; use {choices}."
                self.bad(f"{where} {name}", problem)

    def section(
        self, content: Mapping[str, object], name: str
    ) -> Mapping[str, object] | None:
        found = content.get(name)
        if isinstance(found, dict) and found:
            return found
        self.bad(name, f"[{name}] is missing or empty; write {_EXAMPLE}.")
        return None

    def values(
        self,
        where: str,
        content: object,
        wanted: Mapping[str, Quantity],
        defaults: Mapping[str, float] | None = None,
    ) -> dict[str, float]:
        """Return the values of a section: NaN where one is missing or wrong."""
        if content is None:  # the section is missing, which was added already
            return dict.fromkeys(wanted, np.nan)
        content = content if isinstance(content, dict) else {}
        self.only(where, content, tuple(wanted))
        values = dict(defaults or {})
        for name, quantity in wanted.items():
            field = f"{where} {name}"
            if name in content:
                values[name] = self._value(field, content[name], quantity)
            elif name not in values:
                self.bad(field, f"{field} is missing; write {_EXAMPLE}.")
                values[name] = np.nan
        return values

    def _value(self, field: str, value: object, quantity: Quantity) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            problem = f"{field} is {_short(value)}; it must be {quantity.wanted}."
            self.bad(f"{quantity.name} is not a number", problem)
            return np.nan
        try:
            number = float(value)
        except OverflowError:
            number = np.inf
        fits = self.problems.check(quantity, number, f"{self.path}: {field}")
        return number if fits else np.nan
