"""An engine whose own parameters were identified from observed pushes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sainet.engines.assumed import AssumedProperties
from sainet.engines.planar.engine import PlanarEngine
from sainet.runs.documents import is_number, read_json
from sainet.runs.errors import BadInput
from sainet.runs.folders import CONFIG, remake

FILE = "identified.json"
IDENTIFIED = "identified"  # the name of such an engine on a network's card
FRICTIONS = ("pusher_friction", "disk_friction", "table_friction")
RATIO = "pressure_radius_ratio"
CAMERA = ("camera_x_mm", "camera_y_mm")  # where it sees things minus the robot's
NAMES = (*FRICTIONS, RATIO, *CAMERA)
USUAL_RATIO = 2 / 3  # of a pressure that is uniform


def beliefs_of(values: Mapping[str, float]) -> dict[str, Any]:
    """Return what the engine believes, as a network's card says it; None is the truth.

    Args:
        values: identified ones by their names.
    """
    return {
        "mass": None,
        "radius": None,
        "friction": values.get("table_friction"),
        "pusher_friction": values.get("pusher_friction"),
        "disk_friction": values.get("disk_friction"),
        **{name: values.get(name) for name in (RATIO, *CAMERA)},
    }


def engine_of_beliefs(beliefs: Mapping[str, Any]) -> AssumedProperties:
    """Return the engine that believes so: what `beliefs_of` returns."""
    ratio = beliefs.get(RATIO)
    return AssumedProperties(
        PlanarEngine(pressure_radius_ratio=USUAL_RATIO if ratio is None else ratio),
        mass=None,
        radius=None,
        friction=beliefs.get("friction"),
        pusher_friction=beliefs.get("pusher_friction"),
        disk_friction=beliefs.get("disk_friction"),
    )


def camera_offset(beliefs: Mapping[str, Any]) -> tuple[float, float]:
    """Return where a camera sees things, minus where the robot has them (m)."""
    x, y = (beliefs.get(name) or 0.0 for name in CAMERA)
    return x / 1000, y / 1000


def is_identified(folder: Path) -> bool:
    """Return whether `sainet identify` made a folder, if only begun."""
    try:
        if (folder / FILE).is_file():
            return True
        return read_json(folder / CONFIG).get("command") == "identify"
    # Missing, damaged or no path at all: what is there will tell what it is.
    except (BadInput, OSError):
        return False


def read_values(folder: Path) -> dict[str, float]:
    """Return the values that `sainet identify` left in a folder, by their names.

    Raises:
        BadInput: the file is missing, damaged or holds no such values.
    """
    path = folder / FILE
    if not path.is_file():
        raise BadInput(
            f"{path}: missing, so the identification is unfinished; run the same "
            "'sainet identify' again."
        )
    values = read_json(path).get("values")
    if not isinstance(values, dict) or not values:
        raise BadInput(f"{path}: values is missing; {remake(folder)}.")
    for name, value in values.items():
        if not (name in NAMES and is_number(value) and (name in CAMERA or value > 0)):
            kind = "a number" if name in CAMERA else "a positive number"
            raise BadInput(
                f"{path}: values.{name} is {value!r}; it must be {kind} for one of "
                f"{', '.join(NAMES)}: {remake(folder)}."
            )
    return values
