"""An emulated tracker: Vicon's bytes over loopback, with faults on demand."""

import socket
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from sainet.robots.wire.frames import Rigid

# What can go wrong, from a chosen frame on, and a part of the reason that is expected.
FAULTS = {
    "lose": "no usable frame",
    "delay": "no usable frame",
    "repeat": "came twice",
    "reorder": "came after",
    "truncate": "is damaged",
    "corrupt": "tracker: ",
    "freeze": "frozen",
    "jump": "jumped",
    "swap": "exchanged",
    "hide": "not visible",
    "nan": "NaN",
    "lift": "off its height",
    "tilt": "tilted",
}


USED = 5 + 2 * 75  # bytes of a packet with two objects


def packet(number: int, bodies: dict[str, Rigid], size: int = 512) -> bytes:
    """The bytes of one frame, written from Vicon's description."""
    turns = Rotation.from_matrix([body.rotation for body in bodies.values()])
    angles = turns.as_euler("XYZ")
    items = b"".join(
        struct.pack("<BH24s6d", 0, 72, name.encode(), *1000 * body.shift, *angle)
        for (name, body), angle in zip(bodies.items(), angles, strict=True)
    )
    made = struct.pack("<IB", number, len(bodies)) + items
    assert len(made) <= size
    return made.ljust(size, b"\0")


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@dataclass
class EmulatedTracker:
    """Sends a frame at every tick; a fault begins after some ticks."""

    names: Sequence[str]
    poses: Callable[[], np.ndarray]  # on the table: body x (m, m, rad)
    to_tracker: Rigid  # from the table
    height: float  # m, of the bodies' origins
    port: int
    fault: str = ""
    fault_at: int = 0  # tick
    noise: float = 2e-5  # m and rad
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    tick_count: int = 0
    held: list[bytes] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.frozen: dict[str, Rigid] = {}

    def close(self) -> None:
        self.socket.close()

    def tick(self) -> None:
        self.tick_count += 1
        faulty = self.fault and self.tick_count >= self.fault_at
        for made in self._packets(self.fault if faulty else ""):
            self.socket.sendto(made, ("127.0.0.1", self.port))

    def _packets(self, fault: str) -> list[bytes]:
        made = packet(self.tick_count, self._bodies(fault))
        if fault in {"delay", "reorder"}:
            self.held.append(made)
            if fault == "delay":  # by 100 frames
                return [self.held.pop(0)] if len(self.held) > 100 else []
            return [self.held.pop(), self.held.pop()] if len(self.held) > 1 else []
        damage = {
            "lose": lambda: [],
            "repeat": lambda: [made, made],
            "truncate": lambda: [made[: int(self.rng.integers(USED))]],
            "corrupt": lambda: [self._corrupted(made)],
        }
        return damage.get(fault, lambda: [made])()

    def _corrupted(self, made: bytes) -> bytes:
        damaged = bytearray(made)
        for where in self.rng.integers(USED, size=40):
            damaged[where] ^= int(self.rng.integers(1, 256))
        return bytes(damaged)

    def _bodies(self, fault: str) -> dict[str, Rigid]:
        if fault == "freeze":
            return self.frozen
        names = list(self.names)
        if fault == "swap":
            names[:2] = names[1::-1]
        noise = self.noise * self.rng.standard_normal((len(names), 6))
        if fault == "jump":
            noise[0, 0] += 0.03
        if fault == "lift":
            noise[0, 2] += 0.01
        if fault == "tilt":
            noise[0, 3] += np.deg2rad(10)
        if fault == "nan":
            noise[0, 1] = np.nan
        poses = self.poses()
        turns = np.column_stack([poses[:, 2] + noise[:, 5], noise[:, 4], noise[:, 3]])
        rotations = Rotation.from_euler("ZYX", turns).as_matrix()
        places = np.column_stack([poses[:, :2], np.full(len(names), self.height)])
        bodies = {
            name: self.to_tracker.after(Rigid(rotation, place))
            for name, rotation, place in zip(
                names, rotations, places + noise[:, :3], strict=True
            )
        }
        if fault == "hide":
            del bodies[names[0]]
        order = self.rng.permutation(list(bodies))  # as when visibility changes
        self.frozen = {str(name): bodies[name] for name in order}
        return self.frozen
