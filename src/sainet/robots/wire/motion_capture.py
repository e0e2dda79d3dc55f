"""Motion capture of several makers, by way of the package motioncapture."""

from collections import deque
from importlib import import_module
from threading import Event, Thread
from typing import Any

import numpy as np

from sainet.robots.wire.clock import AbstractClock, RealClock
from sainet.robots.wire.frames import Rigid
from sainet.robots.wire.tracker import AbstractTracker, Frame
from sainet.runs.errors import missing_extra

_MOST_WAITING = 100_000  # frames


class MotionCapture(AbstractTracker):
    """Frames of a system that the package motioncapture supports.

    The package waits without a limit of time, so a thread of its own does that.
    """

    def __init__(
        self, system: str, host: str, clock: AbstractClock | None = None
    ) -> None:
        """Connect.

        Args:
            system: "vicon", "optitrack", "qualisys", "vrpn", ... or "mock".
            host: address of the system.
            clock: of the frames; by default the machine's monotonic clock.

        Raises:
            MissingExtra: the package is not installed.
        """
        try:
            package = import_module("motioncapture")
        except ImportError:
            needs = "Motion capture needs the package motioncapture"
            raise missing_extra(needs, "robot") from None
        self._clock, self._count = clock or RealClock(), 0
        self._waiting = deque[Frame](maxlen=_MOST_WAITING)
        self._ended = Event()
        Thread(target=self._listen, args=(package, system, host), daemon=True).start()

    def frames(self) -> list[Frame]:
        """Return the frames that arrived since the last call, without waiting."""
        return [self._waiting.popleft() for _ in range(len(self._waiting))]

    def discard(self) -> None:
        """Drop the frames that wait."""
        self._waiting.clear()

    def close(self) -> None:
        """Stop listening, after the next frame."""
        self._ended.set()

    def _listen(self, package: Any, system: str, host: str) -> None:  # noqa: ANN401
        try:
            connection = package.connect(system, {"hostname": host})
            while not self._ended.is_set():
                connection.waitForNextFrame()
                bodies = connection.rigidBodies.items()
                self._add({name: _pose(body) for name, body in bodies})
        except Exception as error:  # whatever the package raises
            self._add({}, f"{system} at {host}: {error}")

    def _add(self, poses: dict[str, Rigid], trouble: str = "") -> None:
        self._count += 1
        self._waiting.append(Frame(self._count, self._clock.now(), poses, trouble))


def _pose(body: Any) -> Rigid:  # noqa: ANN401 - a compiled type without stubs
    """Return a pose (m); a quaternion that is none becomes NaN."""
    q = body.rotation
    whole = np.array([q.w, q.x, q.y, q.z], float)
    size = np.linalg.norm(whole)
    w, x, y, z = whole / (size if size > 0 else np.nan)
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return Rigid(np.array(rotation), np.array(body.position, float))
