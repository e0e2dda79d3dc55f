"""Messages from the page, checked when they are read. Free of JAX."""

import re
from typing import Annotated, ClassVar

import msgspec

from sainet.control.worlds import WorldName
from sainet.report.live.config import DISK_COUNTS
from sainet.runs.errors import BadInput, shown
from sainet.worlds.noise import NoiseLevel

LARGEST_MESSAGE = 4096  # bytes
_LONGEST_REASON = 160  # characters
# Errors of msgspec, in words.
_WORDS = {
    "Object missing required field `(.+)`": "{value} is missing",
    "Object contains unknown field `(.+)`": "{value} is not a field of such messages",
    "Invalid (?:enum )?value (.+)": "there is no {field} {value}",
    r"Expected `\w+` >= (.+)": "{field} must be at least {value}",
    r"Expected `\w+` <= (.+)": "{field} must be at most {value}",
    "Expected `array` of length <= (.+)": "{field} must have at most {value} numbers",
    r"Expected `(\w+)`, got .+": "{field} must be {value}",
}
_KINDS = {"int": "a whole number", "float": "a number", "object": "a JSON object"}

Millimetres = Annotated[float, msgspec.Meta(ge=-10_000, le=10_000)]
Angle = Annotated[float, msgspec.Meta(ge=-180, le=180)]
Direction = Annotated[float, msgspec.Meta(ge=-60, le=60)]
Number = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
DiskCount = Annotated[int, msgspec.Meta(ge=DISK_COUNTS[0], le=DISK_COUNTS[-1])]
Name = Annotated[str, msgspec.Meta(max_length=200)]
# Of a world that people can play with; other parts of sainet accept more.
Mass = Annotated[float, msgspec.Meta(ge=0.1, le=5)]  # kg
RadiusMm = Annotated[float, msgspec.Meta(ge=20, le=90)]
Friction = Annotated[float, msgspec.Meta(ge=0.01, le=1)]


class BadMessage(BadInput):
    """A message that the server refuses."""


class _Message(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """What all messages have in common."""

    is_pointer: ClassVar[bool] = False  # of several in a row, only the newest matters

    @property
    def stream(self) -> tuple[object, ...]:
        """What two messages share if the newer replaces the older."""
        return (type(self),)


class Aim(_Message, frozen=True, tag="aim"):
    """Predict a push."""

    number: Number  # returned with the prediction
    contact_angle_deg: Angle
    direction_deg: Direction

    is_pointer: ClassVar[bool] = True


class MoveDisk(_Message, frozen=True, tag="disk"):
    """Put a disk on a place."""

    disk: Number  # from 1
    x_mm: Millimetres
    y_mm: Millimetres

    is_pointer: ClassVar[bool] = True

    @property
    def stream(self) -> tuple[object, ...]:
        """Only moves of one disk replace each other."""
        return (type(self), self.disk)


class MoveGoal(_Message, frozen=True, tag="goal"):
    """Put the goal on a place."""

    x_mm: Millimetres
    y_mm: Millimetres

    is_pointer: ClassVar[bool] = True


class PushNow(_Message, frozen=True, tag="push"):
    """Execute a push in the world."""

    contact_angle_deg: Angle
    direction_deg: Direction


class PlanNow(_Message, frozen=True, tag="plan"):
    """Let the planner select a push, and execute it."""


class ChooseModel(_Message, frozen=True, tag="model"):
    """Plan with another model."""

    model: Name


class ChooseWorld(_Message, frozen=True, tag="world"):
    """Start again in another world."""

    world: WorldName
    noise: NoiseLevel
    disks: DiskCount


class SetProperties(_Message, frozen=True, tag="properties"):
    """Give the disks and the table of the world other properties."""

    mass_kg: Annotated[list[Mass], msgspec.Meta(max_length=DISK_COUNTS[-1])]
    radius_mm: Annotated[list[RadiusMm], msgspec.Meta(max_length=DISK_COUNTS[-1])]
    table_friction: Friction


class Restart(_Message, frozen=True, tag="restart"):
    """Put the disks in a row and draw another goal."""


class Save(_Message, frozen=True, tag="save"):
    """Save the episodes."""


Pointer = Aim | MoveDisk | MoveGoal
Action = PushNow | PlanNow | ChooseModel | ChooseWorld | SetProperties | Restart | Save
Message = Pointer | Action


def read_message(text: str | bytes) -> Message:
    """Return the message in a text.

    Raises:
        BadMessage: it is not JSON, of an unknown type, or a value is out of its range.
    """
    try:
        return msgspec.json.decode(text, type=Message)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        reason = shown(_in_words(str(error)), _LONGEST_REASON)
        raise BadMessage(f"Message refused: {reason}.") from None


def _in_words(error: str) -> str:
    """Return an error of msgspec as a sentence that begins with the field."""
    text, _, place = error.partition(" - at `$.")
    for pattern, words in _WORDS.items():
        if found := re.fullmatch(pattern, text):
            value = _KINDS.get(found[1], found[1])
            return words.format(field=place.strip("`") or "a message", value=value)
    return text


class Status(msgspec.Struct, tag="status"):
    """What the server works on; the page shows it."""

    text: str
    is_ready: bool  # everything is compiled
    can_predict: bool


class Notice(msgspec.Struct, tag="notice"):
    """One sentence for the user: why a message was refused, or what happened."""

    text: str
    is_error: bool = True
