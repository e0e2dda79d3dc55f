"""The physical robot: its route, its recordings, and what stops it.

EGM and Vicon's bytes travel to an emulated controller and from an emulated tracker, on
a simulated clock; the planar engine moves the disks.
"""

import re
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from msgspec.structs import replace

from robots.wire.emulated_controller import (
    EmulatedController,
    Fault,
    Kind,
    SimulatedLink,
)
from robots.wire.emulated_table import EmulatedTable
from robots.wire.emulated_tracker import FAULTS, EmulatedTracker, free_port
from robots.wire.simulated_clock import SimulatedClock
from sainet.datasets.recorded.resample import resample
from sainet.engines import make_engine
from sainet.engines.base import roll_out
from sainet.models.dynamics import PhysicsDynamics
from sainet.planning.levels import roll_pushes
from sainet.robots.wire.abb import AbbRobot, NoPose
from sainet.robots.wire.arm import AbstractArm, DryArm, Stroke
from sainet.robots.wire.cell import Cell, read_cell
from sainet.robots.wire.disks import Measurement
from sainet.robots.wire.executed import Execution
from sainet.robots.wire.guidance import EgmArm
from sainet.robots.wire.limits import CYCLE
from sainet.robots.wire.route import plan_route
from sainet.robots.wire.transport import UdpTransport
from sainet.robots.wire.vicon import ViconStream
from sainet.runs.errors import BadInput, BadScene
from sainet.scenes.controls import PathControls
from sainet.scenes.pushes import Push, PushGrid
from sainet.scenes.recording import Recording
from sainet.scenes.state import State, at_rest
from support import REPOSITORY

EXAMPLE: Cell = read_cell(REPOSITORY / "examples" / "cell.toml")
CELL: Cell = replace(
    EXAMPLE,
    tracker=replace(EXAMPLE.tracker, rate_hz=1 / CYCLE),
    motion=replace(EXAMPLE.motion, travel_speed_mm_s=150.0, hold_s=0.3),
)
TO_ROBOT = CELL.calibration.table_to_robot
TO_TABLE = TO_ROBOT.inverse
TO_TRACKER = CELL.calibration.tracker_to_table.inverse
NAMES = [disk.body for disk in CELL.disks]
LIFTED = 0.02  # m: above it the pusher touches nothing, and disks rest
TIP = (-0.13, 0.05)  # m, on the table, at the start
APART = 2 * 0.0525
TABLE = np.array([[-0.05, 0.02, 2.0], [-0.05 + APART, 0.02, -1.0]])
PUSH: Push = jax.tree.map(lambda x: x[33], PushGrid().pushes())


class LinkedClock(SimulatedClock):
    """A simulated clock; who waits lets the controller go on."""

    link: SimulatedLink

    def wait(self, seconds: float) -> None:
        self.link.idle(seconds)


@dataclass
class Loop:
    """A robot: emulated controller, table with disks, and tracker."""

    robot: AbbRobot
    table: EmulatedTable
    tracker: EmulatedTracker
    controller: EmulatedController
    clock: LinkedClock
    asked: list[str]
    lowest: float = np.inf  # m, of the tip above the table

    def tick(self, tool: np.ndarray) -> None:
        tip = TO_TABLE.moved(tool)
        self.lowest = min(self.lowest, tip[2])
        if tip[2] < LIFTED:
            self.table.carry(tip)
        self.tracker.tick()

    @property
    def sent(self) -> np.ndarray:
        """Commanded positions (m)."""
        return np.array([each.position for each in self.controller.answers])

    def put(self, position: np.ndarray) -> None:
        """Put the disks somewhere else."""
        state, place = self.table.state, jnp.float32(position)
        self.table._state = eqx.tree_at(lambda s: s.position, state, place)


@contextmanager
def loop(
    poses: np.ndarray = TABLE, cell: Cell = CELL, dry: list | None = None
) -> Iterator[Loop]:
    port, clock, asked = free_port(), LinkedClock(), []
    disks = at_rest(jnp.float32(poses[:, :2]), jnp.float32(poses[:, 2]), jnp.zeros(2))
    table = EmulatedTable(cell.scene, disks)
    height, to_tracker = cell.disks[0].height_mm / 1000, TO_TRACKER
    tracker = EmulatedTracker(NAMES, lambda: table.pose, to_tracker, height, port)
    start = TO_ROBOT.moved(np.array([*TIP, 0.06]))
    controller = EmulatedController(start)
    clock.link = SimulatedLink(controller, clock)
    arm: AbstractArm = EgmArm(clock.link, cell.limits, clock)
    if dry is not None:
        arm = DryArm(start, cell.limits, lambda t, row: dry.append(row))
    stream = ViconStream(UdpTransport(controller="127.0.0.1", port=port), clock)
    robot = AbbRobot(cell, arm, stream, ask=asked.append, clock=clock)
    made = Loop(robot, table, tracker, controller, clock, asked)
    controller.carry = made.tick
    with robot, closing(tracker):
        yield made


def known(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    rows = np.isfinite(recording.pose).all(axis=(1, 2))
    return recording.pose[rows], recording.pusher[np.isfinite(recording.pusher[:, 0])]


def predicted(recording: Recording) -> State:
    """The end of the engine's rollout with the recorded pusher."""
    push = resample(recording)
    start, turn = jnp.float32(push.initial[:, :2]), jnp.float32(push.initial[:, 2])
    initial = at_rest(start, turn, jnp.float32(push.initial_pusher))
    speed = np.diff(push.pusher, axis=0, prepend=push.initial_pusher[None]) * 240
    path = PathControls(jnp.float32(push.pusher), jnp.float32(speed))
    states = roll_out(make_engine("planar"), CELL.scene, initial, path).states
    return jax.tree.map(lambda x: x[-1], states)


def test_an_observation_is_the_mean_of_frames_at_rest():
    with loop() as made:
        made.tracker.noise = 2e-4
        found = made.robot.observe()
    np.testing.assert_allclose(found.position, TABLE[:, :2], atol=1e-4)
    np.testing.assert_allclose(found.angle, TABLE[:, 2], atol=1e-4)
    np.testing.assert_allclose(found.pusher_position, TIP, atol=1e-6)
    assert not np.asarray(found.velocity).any()


def test_moving_disks_are_not_observed():
    with loop() as made:
        creep = np.array([0.004, 0, 0])  # m/s
        made.tracker.poses = lambda: made.table.pose + creep * made.clock.now()
        with pytest.raises(NoPose, match="moves, by 0.4"):
            made.robot.observe()


def test_a_push_moves_the_disks_as_the_engine_predicts():
    with loop() as made:
        seen = made.robot.observe()
        recording = made.robot.push(PUSH)
        pose, pusher = known(recording)
        assert (recording.trouble, recording.commanded) == ("", PUSH)
        np.testing.assert_allclose(pose[0], TABLE, atol=2e-4)
        np.testing.assert_allclose(pose[-1], made.table.pose, atol=2e-4)
        # Along the recorded path of the pusher, at the time step of models:
        along = predicted(recording)
        np.testing.assert_allclose(pose[-1, :, :2], along.position, atol=2e-4)
        np.testing.assert_allclose(pose[-1, :, 2], along.angle, atol=0.01)
        # A commanded pusher stops at once, and the disks slide on: 0.8 mm.
        batch = jax.tree.map(lambda x: jnp.asarray(x)[None], (CELL.scene, seen, PUSH))
        wanted = roll_pushes(PhysicsDynamics(make_engine("planar")), *batch, 80).final
        np.testing.assert_allclose(pose[-1, :, :2], wanted.position[0], atol=1e-3)
        np.testing.assert_allclose(pose[-1, :, 2], wanted.angle[0], atol=0.02)
        way = np.linalg.norm(pusher[-1] - pusher[0])
        assert way == pytest.approx(0.010 + 0.005, abs=5e-4)
        speed = np.linalg.norm(np.diff(pusher, axis=0), axis=1) / CYCLE
        np.testing.assert_allclose(speed[30:70], 0.05, rtol=0.02)
        tip = TO_TABLE.moved(made.controller.place)
        assert tip[2] == pytest.approx(CELL.pusher.travel_height_mm / 1000, abs=1e-4)
        assert made.lowest == pytest.approx(CELL.pusher.push_height_mm / 1000, abs=1e-4)


def test_a_recording_has_both_clocks_and_can_be_resampled():
    with loop() as made:
        made.robot.observe()
        recording = made.robot.push(PUSH)
    pose, pusher = known(recording)
    assert recording.time[0] == 0
    assert len(pose) + len(pusher) >= len(recording.time)
    assert recording.conditions.speed_mm_s == pytest.approx(50)
    assert recording.conditions.surface == "abs"
    push = resample(recording)
    np.testing.assert_allclose(push.initial, TABLE, atol=2e-4)
    assert np.isfinite(push.motion[13:-13]).all()


def test_pushes_follow_each_other_and_the_arm_stays_inside_its_limits():
    with loop() as made:
        for _ in range(3):
            made.robot.observe()
            assert not made.robot.push(PUSH).trouble
        sent = made.sent
    limits = CELL.limits
    assert (sent >= limits.low).all() and (sent <= limits.high).all()
    assert np.linalg.norm(np.diff(sent, axis=0), axis=1).max() <= limits.step


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("during", ["approach", "push"])
def test_every_fault_of_the_tracker_stops_the_arm_with_its_reason(fault, during):
    with loop() as made:
        made.robot.observe()
        before = len(made.sent)
        made.tracker.fault = fault
        route = made.robot._route(made.robot.truth, PUSH)  # noqa: SLF001
        into = 100 if during == "approach" else len(route.approach) + 100
        made.tracker.fault_at = made.tracker.tick_count + into
        recording = made.robot.push(PUSH)
        sent = made.sent[before:]
    assert FAULTS[fault] in recording.trouble
    late = round(CELL.tracker.largest_age_s / CYCLE) + 30
    lead = CELL.limits.lag_cycles * (during == "push")
    assert len(sent) <= into + late + lead
    assert (sent >= CELL.limits.low).all() and (sent <= CELL.limits.high).all()
    pose, _ = known(recording)
    assert np.abs(pose - TABLE).max() < 0.02  # no faulty pose among them
    if during == "approach":
        assert recording.commanded is None and len(recording.time) == 1


BROKEN = {
    Kind.SILENCE: "no feedback",
    Kind.REPEAT: "came twice",
    Kind.TRUNCATE: "corrupt",
    Kind.JUMP: "off the commanded path",
    Kind.STRANGER: "another sender",
    Kind.RAPID: "RAPID program is stopped",
}


@pytest.mark.parametrize("kind", BROKEN)
@pytest.mark.parametrize("during", ["approach", "push"])
def test_every_fault_of_the_controller_is_recorded(kind, during):
    with loop() as made:
        made.robot.observe()
        route = made.robot._route(made.robot.truth, PUSH)  # noqa: SLF001
        lead = 2 * CELL.limits.lag_cycles
        into = 50 if during == "approach" else len(route.approach) + lead + 30
        made.controller.fault = Fault(kind, into)
        recording = made.robot.push(PUSH)
        sent = made.sent
    assert BROKEN[kind] in recording.trouble
    assert len(sent) <= into + 5
    assert (recording.commanded is None) == (len(recording.time) == 1)
    assert (len(recording.time) == 1) == (during == "approach")


def test_a_controller_that_stops_before_the_straight_motion_is_recorded():
    with loop() as made:
        made.robot.observe()
        route = made.robot._route(made.robot.truth, PUSH)  # noqa: SLF001
        rows = len(CELL.limits.rows(made.controller.place, route.approach))
        made.controller.fault = Fault(Kind.MOTORS, rows)
        recording = made.robot.push(PUSH)
    assert "motors are off" in recording.trouble
    assert recording.commanded is None and len(recording.time) == 1


def test_a_stopped_push_is_recorded_as_far_as_it_was_commanded():
    with loop() as made:
        made.robot.observe()
        route = made.robot._route(made.robot.truth, PUSH)  # noqa: SLF001
        made.tracker.fault = "hide"
        into = len(route.approach) + 2 * CELL.limits.lag_cycles + 50
        made.tracker.fault_at = made.tracker.tick_count + into
        recording = made.robot.push(PUSH)
    assert recording.commanded is not None
    length = float(recording.commanded.length)
    assert 0 < length < float(PUSH.length)
    _, pusher = known(recording)
    way = np.linalg.norm(pusher[-1] - pusher[0])
    assert way == pytest.approx(length + 0.005, abs=2e-3)
    assert float(recording.commanded.speed) == float(PUSH.speed)


def test_some_faulty_frames_can_be_skipped():
    cell = replace(CELL, tracker=replace(CELL.tracker, most_faulty_frames=3))
    with loop(cell=cell) as made:
        made.robot.observe()
        ticks = iter(range(100_000))
        made.tracker._bodies_of = made.tracker._bodies  # noqa: SLF001
        made.tracker._bodies = lambda fault: made.tracker._bodies_of(  # noqa: SLF001
            "hide" if next(ticks) % 50 < 3 else fault
        )
        recording = made.robot.push(PUSH)
    assert not recording.trouble
    pose, pusher = known(recording)
    assert len(pose) < 0.96 * len(pusher)


REFUSED = {
    "outside": (TABLE - [0.2, 0, 0], PUSH, "outside the workspace"),
    "on a disk": (
        TABLE,
        eqx.tree_at(lambda p: p.contact_angle, PUSH, jnp.float32(np.pi)),
        "would descend",
    ),
    "too fast": (
        TABLE,
        eqx.tree_at(lambda p: p.speed, PUSH, jnp.float32(0.4)),
        "speed limit",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_push_outside_the_limits_is_refused_before_anything_moves(case):
    poses, push, reason = REFUSED[case]
    with loop(poses) as made:
        made.robot.observe()
        recording = made.robot.push(push)
        assert not len(made.sent)
    assert reason in recording.trouble and "\n" not in recording.trouble
    assert recording.commanded is None
    np.testing.assert_allclose(recording.pose[0], poses, atol=1e-4)


def test_a_disk_that_was_moved_by_hand_is_not_pushed():
    with loop() as made:
        made.robot.observe()
        made.put(TABLE[:, :2] + 0.004)
        recording = made.robot.push(PUSH)
        assert made.lowest == pytest.approx(CELL.pusher.push_height_mm / 1000, abs=1e-4)
    assert re.search(r"'disk-.' moved 5.\d mm before the push", recording.trouble)


def test_disks_that_still_move_and_a_disk_that_does_not_are_reported():
    short = replace(CELL, motion=replace(CELL.motion, hold_s=0.0))
    fast = eqx.tree_at(lambda p: p.speed, PUSH, jnp.float32(0.14))
    with loop(cell=short) as made:
        made.robot.observe()
        assert "come to rest" in made.robot.push(fast).trouble
    little = eqx.tree_at(lambda p: p.length, PUSH, jnp.float32(1e-4))
    with loop() as made:
        made.robot.observe()
        assert made.robot.push(little).trouble == "disk 1 did not move"


def test_a_slow_tracker_also_sees_disks_that_still_move():
    cell = replace(CELL, tracker=replace(CELL.tracker, rate_hz=10.0))
    state = at_rest(jnp.float32(TABLE[:, :2]), jnp.float32(TABLE[:, 2]), jnp.zeros(2))
    found = [Measurement(i, i / 10, TABLE + [0.003 * i, 0, 0]) for i in range(4)]
    tip = TO_ROBOT.moved(np.array([*TIP, 0.06]))
    route = plan_route(cell, cell.scene, tip, state, PUSH)
    stroke = Stroke.of([(0.0, tip, tip)])
    executed = Execution(cell, state, PUSH, route, stroke, found)
    assert "come to rest" in executed.problem


def test_a_dry_run_shows_every_command_and_sends_none():
    rows: list[np.ndarray] = []
    with loop(dry=rows) as made:
        recording = made.robot.push(PUSH)
        route = made.robot._route(made.robot.truth, PUSH)  # noqa: SLF001
        np.testing.assert_array_equal(made.table.pose, np.float32(TABLE))
    assert recording.trouble == "dry run: nothing was sent"
    shown = np.array(rows)
    for row in (route.approach[-1], route.straight[len(route.straight) // 2]):
        assert np.linalg.norm(shown - row, axis=1).min() < 1e-3
    assert np.isnan(recording.pose).all()


def test_people_are_asked_until_the_disks_are_in_place():
    goal = at_rest(
        jnp.float32(TABLE[:, :2] + [0.05, -0.03]), jnp.zeros(2), jnp.zeros(2)
    )
    with loop() as made:

        def put(request: str) -> None:
            made.asked.append(request)
            off = [0.03, 0.002][min(len(made.asked), 2) - 1]
            made.put(np.asarray(goal.position) + off)

        made.robot._ask = put  # noqa: SLF001
        made.robot.arrange(goal)
        assert len(made.asked) == 2
        assert "'disk-1' at (0, -10) mm, turned to 0 degrees" in made.asked[0]
        assert "42 mm off" in made.asked[1]
        np.testing.assert_allclose(
            made.robot.truth.position, goal.position + 0.002, atol=1e-4
        )


def test_disks_that_nobody_arranges_are_one_line():
    far = at_rest(jnp.float32(TABLE[:, :2] + 0.1), jnp.zeros(2), jnp.zeros(2))
    with loop() as made:
        with pytest.raises(NoPose, match="not arranged.*141 mm"):
            made.robot.arrange(far)
        assert len(made.asked) == 3


def test_a_tracker_that_names_no_such_body_lists_those_that_it_names():
    with loop() as made:
        made.robot.check_names()
        made.tracker.names = ["disk-1", "disc-2"]
    with loop() as made:
        made.tracker.names = ["disk-1", "disc-2"]
        with pytest.raises(BadInput, match=r"disk-2.*Available: disc-2, disk-1"):
            made.robot.check_names()
    with loop() as made:
        made.tracker.fault = "lose"
        with pytest.raises(BadInput, match="named no body in 5 s"):
            made.robot.check_names()


def test_the_robot_closes_its_connections():
    with loop() as made:
        port = made.tracker.port
        with pytest.raises(BadInput, match="another process listens"):
            UdpTransport(controller="127.0.0.1", port=port)
    again = UdpTransport(controller="127.0.0.1", port=port)
    assert again.port == port
    again.close()


@pytest.mark.parametrize("speed", [0.0, -0.05, np.nan])
def test_a_push_out_of_range_is_refused_before_anything_moves(speed):
    bad = eqx.tree_at(lambda push: push.speed, PUSH, jnp.float32(speed))
    with loop() as made:
        made.robot.observe()
        before = made.controller.place.copy()
        with pytest.raises(BadScene, match=f"push: speed is {speed:g}"):
            made.robot.push(bad)
        np.testing.assert_array_equal(made.controller.place, before)
