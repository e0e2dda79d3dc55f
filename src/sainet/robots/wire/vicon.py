"""Vicon's object stream: packets of poses over UDP.

A packet is packed and little-endian: frame number and count of items, then for each
item an identifier, the size of its data, a name, translations (mm) and Euler angles
XYZ (rad): the rotation is Rx Ry Rz. A packet has a fixed size; its rest is filled.
"""

import struct
from collections.abc import Iterator
from itertools import islice

import numpy as np
from jaxtyping import Float

from sainet.robots.wire.clock import AbstractClock, RealClock
from sainet.robots.wire.frames import Rigid
from sainet.robots.wire.limits import Stopped
from sainet.robots.wire.tracker import AbstractTracker, Frame
from sainet.robots.wire.transport import AbstractTransport

_HEAD = struct.Struct("<IB")  # frame number, items
_ITEM = struct.Struct("<BH")  # identifier, size of its data
_POSE = struct.Struct("<24s6d")  # name, x y z (mm), angles about x, y, z (rad)
_OBJECT = 0  # identifier of items with a pose
_MOST_AT_ONCE = 1000  # packets that wait


def decode(packet: bytes, now: float) -> Frame:
    """Return the frame in a packet, with a trouble if it cannot be read.

    Args:
        packet: the bytes.
        now: when it arrived (s).
    """
    number = int.from_bytes(packet[:4], "little")
    try:
        return Frame(number, now, dict(_bodies(packet)))
    except (struct.error, UnicodeDecodeError, ValueError) as reason:
        text = f"a packet of {len(packet)} bytes is damaged ({reason})"
        return Frame(number, now, {}, text)


def _bodies(packet: bytes) -> Iterator[tuple[str, Rigid]]:
    _, count = _HEAD.unpack_from(packet)
    start, names = _HEAD.size, set[str]()
    for _ in range(count):
        kind, size = _ITEM.unpack_from(packet, start)
        start += _ITEM.size
        if kind == _OBJECT:
            if size != _POSE.size:
                raise ValueError(f"an object of {size} bytes")
            raw, *values = _POSE.unpack_from(packet, start)
            name = raw.partition(b"\0")[0].decode()
            if name in names or not name.isprintable():
                raise ValueError("an object appears twice, or has an unprintable name")
            names.add(name)
            if any(values):  # all zero: the object is not visible
                yield name, _pose(np.array(values))
        start += size
    if start > len(packet):
        raise ValueError("it ends too early")


def _pose(values: Float[np.ndarray, "6"]) -> Rigid:
    """Return the pose of translations (mm) and Euler angles (rad)."""
    with np.errstate(invalid="ignore"):  # of infinity: NaN
        (a, b, c), (d, e, f) = np.cos(values[3:]), np.sin(values[3:])
    about_x = np.array([[1, 0, 0], [0, a, -d], [0, d, a]])
    about_y = np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]])
    about_z = np.array([[c, -f, 0], [f, c, 0], [0, 0, 1]])
    return Rigid(about_x @ about_y @ about_z, values[:3] / 1000)


class ViconStream(AbstractTracker):
    """Listens to Vicon's object stream."""

    def __init__(
        self, transport: AbstractTransport, clock: AbstractClock | None = None
    ) -> None:
        """Take over the transport; closing the stream closes it.

        Args:
            transport: from the tracker.
            clock: of the frames; by default the machine's monotonic clock.
        """
        self._transport, self._clock = transport, clock or RealClock()

    def frames(self) -> list[Frame]:
        """Return the frames that arrived since the last call, without waiting."""
        received = iter(self._received, None)
        return list(islice(received, _MOST_AT_ONCE))

    def _received(self) -> Frame | None:
        try:
            packet = self._transport.receive(0.0)
        except Stopped as stopped:
            return Frame(0, self._clock.now(), {}, str(stopped))
        return None if packet is None else decode(packet, self._clock.now())

    def discard(self) -> None:
        """Drop the frames that wait."""
        self._transport.discard()

    def close(self) -> None:
        """Stop listening."""
        self._transport.close()
