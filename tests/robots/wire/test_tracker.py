"""Vicon's bytes, motion capture, and the poses of disks that come of them."""

import socket
import sys
import time
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.spatial.transform import Rotation

from robots.wire.emulated_tracker import FAULTS, EmulatedTracker, free_port, packet
from robots.wire.simulated_clock import SimulatedClock
from sainet.robots.wire.cell import Cell, read_cell
from sainet.robots.wire.clock import AbstractClock
from sainet.robots.wire.disks import DiskTracker
from sainet.robots.wire.frames import Rigid
from sainet.robots.wire.motion_capture import MotionCapture
from sainet.robots.wire.tracker import AbstractTracker, Frame
from sainet.robots.wire.transport import UdpTransport
from sainet.robots.wire.vicon import ViconStream, decode
from sainet.runs.errors import BadInput
from support import REPOSITORY

CELL: Cell = read_cell(REPOSITORY / "examples" / "cell.toml")
NAMES = [disk.body for disk in CELL.disks]
TABLE = np.array([[0.02, -0.03, 3.1], [0.13, -0.03, -0.5]])
TO_TABLE = CELL.calibration.tracker_to_table


def stream(port: int, clock: AbstractClock | None = None) -> ViconStream:
    return ViconStream(UdpTransport(controller="127.0.0.1", port=port), clock)


def emulated(port: int, poses=lambda: TABLE, **settings) -> EmulatedTracker:
    height = CELL.disks[0].height_mm / 1000
    return EmulatedTracker(NAMES, poses, TO_TABLE.inverse, height, port, **settings)


class Listed(AbstractTracker):
    """Gives frames of a list."""

    def __init__(self) -> None:
        self.waiting: list[Frame] = []

    def frames(self) -> list[Frame]:
        found, self.waiting = self.waiting, []
        return found

    def discard(self) -> None:
        self.waiting = []

    def close(self) -> None:
        pass


def disks_of(tracker: AbstractTracker, **limits) -> DiskTracker:
    settings = replace(CELL.tracker, **limits)
    return DiskTracker(tracker, CELL.disks, TO_TABLE, settings)


@pytest.mark.parametrize(("size", "count"), [(256, 3), (512, 6), (1024, 13)])
def test_packets_round_trip(size, count):
    rng = np.random.default_rng(size)
    bodies = {
        f"body {i}": Rigid(Rotation.random(rng=rng).as_matrix(), rng.normal(size=3))
        for i in range(count)
    }
    found = decode(packet(7, bodies, size), 1.5)
    assert (found.number, found.time, found.trouble) == (7, 1.5, "")
    assert list(found.bodies) == list(bodies)
    for name, body in bodies.items():
        np.testing.assert_allclose(found.bodies[name].rotation, body.rotation)
        np.testing.assert_allclose(found.bodies[name].shift, body.shift)


def test_objects_at_zero_are_not_visible():
    still = Rigid(np.eye(3), np.zeros(3))
    seen = Rigid(np.eye(3), np.ones(3))
    assert list(decode(packet(1, {"a": still, "b": seen}), 0.0).bodies) == ["b"]


def test_names_fill_their_field():
    name = "x" * 24
    assert list(decode(packet(1, {name: Rigid(np.eye(3), np.ones(3))}), 0).bodies) == [
        name
    ]


def test_damaged_packets_are_reported_and_raise_nothing():
    rng = np.random.default_rng(0)
    whole = packet(1, {n: Rigid(np.eye(3), np.ones(3)) for n in NAMES}, 256)
    for size in range(5 + 2 * 75):
        assert "damaged" in decode(whole[:size], 0.0).trouble, size
    for _ in range(2000):
        damaged = bytearray(whole)
        for where in rng.integers(len(whole), size=5):
            damaged[where] = int(rng.integers(256))
        with np.errstate(over="ignore"):
            decode(bytes(damaged), 0.0)
        decode(rng.bytes(int(rng.integers(1200))), 0.0)
    twice = packet(1, {"a": Rigid(np.eye(3), np.ones(3))})
    twice = twice[:4] + b"\2" + twice[5:80] + twice[5:80]
    assert "twice" in decode(twice, 0.0).trouble
    lines = packet(1, {"a\nb": Rigid(np.eye(3), np.ones(3))})
    assert "unprintable" in decode(lines, 0.0).trouble


def test_the_stream_listens_to_the_configured_address_only():
    port = free_port()
    mine = packet(1, {"a": Rigid(np.eye(3), np.ones(3))})
    with (
        closing(stream(port)) as tracker,
        socket.socket(type=socket.SOCK_DGRAM) as sender,
    ):
        assert tracker.frames() == []
        sender.bind(("127.0.0.2", 0))
        sender.sendto(mine, ("127.0.0.1", port))
        (found,) = tracker.frames()
        assert "another sender" in found.trouble and not found.bodies
    with (
        closing(stream(port)) as tracker,
        socket.socket(type=socket.SOCK_DGRAM) as sender,
    ):
        sender.sendto(mine, ("127.0.0.1", port))
        assert [frame.number for frame in tracker.frames()] == [1]


def test_another_process_on_the_port_is_one_line():
    port = free_port()
    with (
        closing(stream(port)),
        pytest.raises(BadInput, match=rf"port {port} of .*choose") as error,
    ):
        stream(port)
    assert "\n" not in str(error.value)


def test_measured_poses_are_those_of_the_table():
    port = free_port()
    sender = emulated(port, noise=1e-9)
    with closing(stream(port)) as tracker:
        disks = disks_of(tracker)
        for _ in range(5):
            sender.tick()
        found = disks.measure()
    assert [each.trouble for each in found] == [""] * 5
    np.testing.assert_allclose(found[-1].pose, TABLE, atol=1e-7)
    assert disks.named == set(NAMES)
    sender.close()


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_has_its_reason_and_no_pose(fault):
    port, clock = free_port(), SimulatedClock()
    sender = emulated(port, fault=fault, fault_at=10)
    with closing(stream(port, clock)) as tracker:
        disks = disks_of(tracker)
        disks.pause(0.0)
        reasons, first = [], None
        for tick in range(60):
            clock.advance_to(tick / 250)
            sender.tick()
            reasons += [m.trouble for m in disks.measure() if m.trouble]
            reasons += [disks.silence(clock.now())]
            if first is None and any(reasons):
                first = tick
    reason = next(filter(None, reasons))
    assert FAULTS[fault] in reason
    late = CELL.tracker.largest_age_s * 250 + 2
    assert first is not None and 9 <= first <= 9 + late
    sender.close()


def test_faulty_frames_have_no_pose():
    tracker = Listed()
    disks = disks_of(tracker)
    tracker.waiting = [Frame(1, 0.0, {}), Frame(2, 0.0, {}, "noise")]
    for found in disks.measure():
        assert found.trouble and np.isnan(found.pose).all()


def frame(number: int, pose: np.ndarray, time: float | None = None) -> Frame:
    bodies = {
        name: TO_TABLE.inverse.after(
            Rigid(
                Rotation.from_euler("Z", angle).as_matrix(),
                np.array([x, y, CELL.disks[0].height_mm / 1000]),
            )
        )
        for name, (x, y, angle) in zip(NAMES, pose, strict=True)
    }
    return Frame(number, number / 250 if time is None else time, bodies)


def test_angles_are_not_wrapped():
    tracker = Listed()
    disks = disks_of(tracker)
    turns = [[0, 0, 0.02 * k] for k in range(1000)]
    tracker.waiting = [frame(k, TABLE + turn) for k, turn in enumerate(turns)]
    found = np.array([each.pose for each in disks.measure()])
    assert np.isfinite(found).all()
    np.testing.assert_allclose(np.diff(found[:, :, 2], axis=0), 0.02, atol=1e-9)


def test_disks_may_move_while_nobody_measures_but_not_change_places():
    tracker = Listed()
    disks = disks_of(tracker)
    moved = TABLE + [0.05, 0, 0]

    def trouble(number, pose):
        disks.pause(0.0)
        tracker.waiting = [frame(number, pose)]
        return disks.measure()[0].trouble

    assert not trouble(1, TABLE)
    assert not trouble(2, moved)
    assert "exchanged" in trouble(3, moved[::-1])
    assert not trouble(1, moved)  # a tracker that started again counts anew
    disks.forget(0.0)
    assert not trouble(4, moved[::-1])


def test_a_lost_frame_excuses_the_way_of_its_time_only():
    tracker = Listed()
    disks = disks_of(tracker)
    step = np.array([0.0028, 0, 0])  # in one frame of 4 ms at most 2 + 1 mm
    tracker.waiting = [frame(1, TABLE), frame(2, TABLE + step), frame(3, TABLE)]
    assert not any(each.trouble for each in disks.measure())
    tracker.waiting = [frame(5, TABLE + 1.6 * step)]
    assert not disks.measure()[0].trouble
    tracker.waiting = [frame(10**6, TABLE + 12 * step, 6 / 250)]
    assert "jumped" in disks.measure()[0].trouble


def test_a_turn_is_a_jump_of_the_rim():
    tracker = Listed()
    disks = disks_of(tracker)
    tracker.waiting = [frame(1, TABLE), frame(2, TABLE + [0, 0, 0.2])]
    assert "jumped" in disks.measure()[1].trouble


def wait(tracker: AbstractTracker) -> list[Frame]:
    until = time.monotonic() + 5
    while time.monotonic() < until:
        if found := tracker.frames():
            return found
        time.sleep(0.01)
    raise AssertionError("no frame in 5 s")


def test_motion_capture_runs_with_the_mock_of_the_package():
    with closing(MotionCapture("mock", "127.0.0.1")) as tracker:
        first = wait(tracker)[0]
    assert (first.number, first.bodies, first.trouble) == (1, {}, "")


def test_an_unknown_system_is_reported():
    with closing(MotionCapture("none", "127.0.0.1")) as tracker:
        assert "none at 127.0.0.1: Unknown" in wait(tracker)[0].trouble


def test_whatever_the_package_raises_is_reported(monkeypatch):
    def fail():
        raise ValueError("bad stream")

    package = SimpleNamespace(
        connect=lambda kind, settings: SimpleNamespace(waitForNextFrame=fail)
    )
    monkeypatch.setitem(sys.modules, "motioncapture", package)
    with closing(MotionCapture("vrpn", "127.0.0.1")) as tracker:
        assert wait(tracker)[0].trouble == "vrpn at 127.0.0.1: bad stream"


def test_motion_capture_gives_the_poses_of_the_package(monkeypatch):
    turn = Rotation.from_euler("XYZ", [0.3, -0.2, 2.0])
    x, y, z, w = 2 * turn.as_quat()  # of any length
    body = SimpleNamespace(
        position=np.array([1, 2, 3], np.float32),
        rotation=SimpleNamespace(x=x, y=y, z=z, w=w),
    )
    none = SimpleNamespace(x=0, y=0, z=0, w=0)
    bodies = {"a": body, "b": SimpleNamespace(position=np.zeros(3), rotation=none)}
    made = SimpleNamespace(
        rigidBodies=bodies, waitForNextFrame=lambda: time.sleep(0.01)
    )
    package = SimpleNamespace(connect=lambda kind, settings: made)
    monkeypatch.setitem(sys.modules, "motioncapture", package)
    with closing(MotionCapture("vrpn", "127.0.0.1")) as tracker:
        found = wait(tracker)[0].bodies
    np.testing.assert_allclose(found["a"].rotation, turn.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(found["a"].shift, [1, 2, 3])
    assert np.isnan(found["b"].rotation).all()


def test_a_missing_package_is_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "motioncapture", None)
    with pytest.raises(BadInput, match=r"sainet\[robot\]"):
        MotionCapture("mock", "127.0.0.1")
