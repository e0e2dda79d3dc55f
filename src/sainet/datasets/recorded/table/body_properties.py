"""What somebody's own disks are: a TOML file of masses and radii."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from sainet.datasets.recorded.files import read_bytes
from sainet.datasets.recorded.frictions import (
    CONTACT_FRICTION,
    TABLE_FRICTION,
    check_frictions,
)
from sainet.runs.errors import BadTable

EXAMPLE = "[bodies.NAME] with mass = 0.9 and radius = 0.05, and [pusher] radius = 0.005"
_SECTIONS = {"bodies", "pusher", "friction"}


class _Most(NamedTuple):
    """The largest value that is believed, and what a larger one seems to be in."""

    value: float
    unit: str
    seems: str


_LARGEST = {
    "mass": _Most(100.0, "kilograms", "grams"),
    "radius": _Most(1.0, "metres", "millimetres"),
}


@dataclass(frozen=True, kw_only=True)
class BodyProperties:
    """The disks in their order, the pusher, and the frictions."""

    names: tuple[str, ...]
    mass: tuple[float, ...]  # kg
    radius: tuple[float, ...]  # m
    pusher_radius: float  # m
    table_friction: float
    contact_friction: float


def read_properties(
    path: Path, contact_friction: float | None = None
) -> BodyProperties:
    """Read what the disks are.

    Args:
        path: a TOML file with `[bodies.NAME] mass, radius`, `[pusher] radius` and maybe
            `[friction] table, contact`.
        contact_friction: in the place of what the file says.

    Raises:
        BadTable: with the file, the field and the way out.
        BadInput: a friction is negative or no number.
    """
    content = _load(path)
    _only(path, "the file", content, _SECTIONS)
    bodies = _section(path, content, "bodies")
    friction = _section(path, content, "friction") if "friction" in content else {}
    _only(path, "[friction]", friction, {"table", "contact"})
    pusher = _section(path, content, "pusher")
    _only(path, "[pusher]", pusher, {"radius"})
    for name in bodies:
        _only(path, _body(name), _section(path, bodies, name), {"mass", "radius"})
    names = tuple(bodies)
    table = _friction(path, friction, "table", TABLE_FRICTION)
    contact = _friction(path, friction, "contact", CONTACT_FRICTION)
    found = BodyProperties(
        names=names,
        mass=tuple(_property(path, _body(n), bodies[n], "mass") for n in names),
        radius=tuple(_property(path, _body(n), bodies[n], "radius") for n in names),
        pusher_radius=_property(path, "[pusher]", pusher, "radius"),
        table_friction=table,
        contact_friction=contact if contact_friction is None else contact_friction,
    )
    check_frictions(found.contact_friction, found.table_friction)
    return found


def _load(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(read_bytes(path).decode())
    except (ValueError, RecursionError) as error:
        reason = str(error).partition("\n")[0]
        raise BadTable(f"{path}: is no TOML ({reason}); write {EXAMPLE}.") from None


def _body(name: str) -> str:
    return f"[bodies.{name[:40]!r}]"


def _section(path: Path, content: dict[str, Any], name: str) -> dict[str, Any]:
    found = content.get(name)
    if not isinstance(found, dict) or not found:
        raise BadTable(f"{path}: {name[:40]!r} is missing or empty; write {EXAMPLE}.")
    return found


def _only(path: Path, where: str, content: dict[str, Any], known: set[str]) -> None:
    for name in content:
        if name not in known:
            raise BadTable(
                f"{path}: {where} has an unknown field {name[:40]!r}; it may have "
                f"{', '.join(sorted(known))}."
            )


def _positive(path: Path, where: str, content: dict[str, Any], name: str) -> float:
    if name not in content:
        raise BadTable(f"{path}: {where} has no {name}; write {EXAMPLE}.")
    value = _number(content[name])
    if not 0 < value < float("inf"):
        found = f"{content[name]!r}"[:40]
        raise BadTable(f"{path}: {where} {name} is {found}; it must be positive.")
    return value


def _number(value: object) -> float:
    """Return a number, NaN for what is none or too large for one."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return float("nan")
    try:
        return float(value)
    except OverflowError:
        return float("nan")


def _property(path: Path, where: str, content: dict[str, Any], name: str) -> float:
    """Return a mass or a radius that is not in other units."""
    value, most = _positive(path, where, content, name), _LARGEST[name]
    if value > most.value:
        raise BadTable(
            f"{path}: {where} {name} is {value:g}: looks like {most.seems}; it is in "
            f"{most.unit}."
        )
    return value


def _friction(path: Path, content: dict[str, Any], name: str, default: float) -> float:
    value = _number(content.get(name, default))
    if not 0 <= value < float("inf"):
        found = f"{content[name]!r}"[:40]
        raise BadTable(
            f"{path}: [friction] {name} is {found}; it must be zero or positive."
        )
    return value
