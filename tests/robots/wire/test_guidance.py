import gc
import os
import re
import subprocess
import sys

import numpy as np
import pytest

from robots.wire.emulated_controller import (
    EmulatedController,
    Fault,
    Kind,
    SimulatedLink,
)
from robots.wire.faulty_pushes import (
    HOME,
    LIMITS,
    REASONS,
    problems,
    run_real,
    run_simulated,
    straight,
    table,
)
from robots.wire.simulated_clock import SimulatedClock
from sainet.robots.wire.arm import NoFeedback
from sainet.robots.wire.clock import RealClock
from sainet.robots.wire.guidance import PATIENCE, EgmArm
from sainet.robots.wire.limits import CYCLE, Stopped
from sainet.robots.wire.transport import LOOPBACK, UdpTransport

AHEAD = np.array([0.04, 0.0, 0.0])  # m
PATH = straight(HOME, HOME + AHEAD, 0.05)


class Cell:
    """An arm, an emulated controller, and the simulated clock of both."""

    def __init__(self, fault: Fault | None = None, **controller):
        self.clock = SimulatedClock()
        self.controller = EmulatedController(HOME, fault, **controller)
        self.link = SimulatedLink(self.controller, self.clock)
        self.arm = EgmArm(self.link, LIMITS, self.clock)

    @property
    def commands(self) -> np.ndarray:
        return np.array([each.position for each in self.controller.answers])


def test_an_arm_follows_a_path():
    cell = Cell()
    stroke = cell.arm.follow(PATH)
    assert not stroke.trouble
    np.testing.assert_allclose(cell.commands, stroke.commanded, atol=1e-12)
    sent = stroke.commanded[len(stroke.commanded) - len(PATH) - LIMITS.lag_cycles :]
    np.testing.assert_array_equal(sent[: len(PATH)], PATH)
    np.testing.assert_array_equal(sent[len(PATH) :], [PATH[-1]] * LIMITS.lag_cycles)
    np.testing.assert_allclose(np.diff(stroke.time), CYCLE)
    np.testing.assert_allclose(stroke.measured[-1], PATH[-1], atol=1e-4)
    np.testing.assert_allclose(cell.arm.position(), PATH[-1], atol=1e-4)


def test_the_arm_is_behind_its_commands_by_the_lag():
    stroke = Cell(lag=0.015, dead=2).arm.follow(PATH)
    middle = len(PATH) // 2
    behind = (stroke.commanded - stroke.measured)[middle, 0] / 0.05
    assert behind == pytest.approx(0.015 + 3 * CYCLE, abs=CYCLE)


def test_sequence_and_clock_of_a_controller_wrap_around():
    stroke = Cell(sequence=(1 << 32) - 100, stamp=float((1 << 32) - 700)).arm.follow(
        PATH
    )
    assert not stroke.trouble


def test_each_answer_holds_the_orientation_and_has_a_number():
    cell = Cell()
    cell.arm.follow(PATH)
    numbers = [each.number for each in cell.controller.answers]
    assert numbers == list(range(1, len(numbers) + 1))


@pytest.mark.parametrize("kind", Kind)
@pytest.mark.parametrize("after", [1, 60, 120])
def test_every_fault_stops_the_arm_with_its_reason(kind: Kind, after: int):
    cell = Cell(Fault(kind, after, 4))
    stroke = cell.arm.follow(PATH)
    if cell.controller.fault.harmless:
        assert not stroke.trouble
        return
    assert re.search(REASONS[kind], stroke.trouble)
    count = len(cell.controller.answers)
    cell.link.idle(0.5)
    assert len(cell.controller.answers) == count == len(stroke.time)


def test_an_arm_that_was_stopped_rests_at_its_last_command():
    cell = Cell(Fault(Kind.SILENCE, 100))
    cell.arm.follow(PATH)
    cell.link.idle(0.5)
    np.testing.assert_allclose(cell.controller.place, cell.commands[-1], atol=1e-6)


def test_commands_stop_with_the_feedback():
    cell = Cell(Fault(Kind.SILENCE, 100))
    stroke = cell.arm.follow(PATH)
    last = cell.controller.answers[-1].time
    assert last - cell.controller.last_sent < CYCLE
    assert cell.clock.now() - stroke.time[-1] == pytest.approx(3 * CYCLE)


def test_a_motion_continues_after_a_fault_is_mended():
    cell = Cell(Fault(Kind.MOTORS, 50))
    assert cell.arm.follow(PATH).trouble
    cell.controller.begin(None)
    cell.link.idle(0.5)
    place = cell.arm.position()
    stroke = cell.arm.follow(straight(place, place + AHEAD, 0.05))
    assert not stroke.trouble


def test_an_idle_controller_is_answered_with_its_own_position():
    cell = Cell(Fault(Kind.EGM, 0))
    stroke = cell.arm.follow(PATH)
    why = "the controller was not ready within 5 s: .* EGM is not running"
    assert re.match(why, stroke.trouble)
    assert cell.clock.now() == pytest.approx(PATIENCE, abs=0.1)
    assert len(cell.commands) > 1000
    np.testing.assert_allclose(cell.commands, [HOME] * len(cell.commands))
    assert not len(stroke.time)


def test_an_idle_controller_outside_the_workspace_is_not_answered():
    cell = Cell(Fault(Kind.EGM, 0))
    cell.controller._servo = HOME + [0.0, 0.0, 0.1]
    cell.arm.follow(PATH)
    assert not cell.controller.answers


class Restarted(SimulatedLink):
    """A controller that sends from another port until what it sent is dropped."""

    known = False

    def receive(self, timeout: float) -> bytes | None:
        if not self.known:
            raise Stopped("feedback from another sender")
        return super().receive(timeout)

    def discard(self) -> None:
        self.known = True


@pytest.mark.parametrize("act", ["follow", "position"])
def test_a_controller_may_restart_between_motions(act: str):
    cell = Cell()
    arm = EgmArm(Restarted(cell.controller, cell.clock), LIMITS, cell.clock)
    if act == "position":
        np.testing.assert_allclose(arm.position(), HOME)
    else:
        assert not arm.follow(PATH).trouble


def test_a_controller_that_becomes_ready_is_waited_for():
    cell = Cell(Fault(Kind.EGM, 0))
    tick = cell.controller.tick

    def mend(time: float):
        if time > 2.0 and cell.controller.fault is not None:
            cell.controller.begin(None)
        return tick(time)

    cell.controller.tick = mend
    stroke = cell.arm.follow(PATH)
    assert not stroke.trouble and stroke.time[0] > 2.0


def test_no_motion_starts_while_the_arm_moves():
    cell = Cell()
    cell.arm.follow(PATH[:-1])
    cell.controller.begin(None)
    # The arm goes back: somebody jogs it.
    cell.controller._target = HOME
    cell.link.idle(0.02)
    stroke = cell.arm.follow(straight(HOME, HOME + AHEAD, 0.05))
    assert not stroke.trouble
    np.testing.assert_allclose(cell.commands[0], HOME, atol=2e-4)


def test_refused_paths_are_not_begun():
    cell = Cell()
    stroke = cell.arm.follow(PATH + [0.0, 0.0, 0.1])
    assert "refused" in stroke.trouble
    assert not cell.controller.answers
    assert stroke.commanded.shape == stroke.measured.shape == (0, 3)


@pytest.mark.parametrize("kind", [Kind.HICCUP, Kind.BUNCH, Kind.DELAY])
def test_messages_that_were_held_up_do_not_speed_the_arm_up(kind: Kind):
    fault = Fault(kind, 50, 1)
    cell = Cell(fault)
    path = straight(HOME, HOME + AHEAD, LIMITS.speed)
    stroke = cell.arm.follow(path)
    assert not stroke.trouble
    np.testing.assert_allclose(cell.commands[-1], path[-1])
    assert not list(problems(fault, path, stroke, cell.controller, real_time=False))


def test_a_frozen_position_stops_the_arm_within_three_cycles():
    cell = Cell(Fault(Kind.FREEZE, 60))
    stroke = cell.arm.follow(PATH)
    assert stroke.trouble.startswith("frozen feedback: 4 messages in a row report (5")
    assert (cell.controller.answers[-1].time - cell.controller.faulty) < 3 * CYCLE


def test_an_arm_at_rest_is_not_frozen():
    there = straight(HOME, HOME + AHEAD, 0.05)
    path = np.concatenate([there, np.repeat(there[-1:], 200, axis=0), there[::-1]])
    cell = Cell(lag=1e-3, dead=0)  # stands still to the last bit
    assert not cell.arm.follow(path).trouble


def test_a_position_sends_nothing_and_needs_feedback():
    cell = Cell()
    np.testing.assert_allclose(cell.arm.position(), HOME)
    assert not cell.controller.answers
    cell.controller.begin(Fault(Kind.SILENCE, 0))
    with pytest.raises(NoFeedback, match="nothing arrived.*RAPID"):
        cell.arm.position()
    cell.controller.begin(Fault(Kind.NAN, 0))
    with pytest.raises(NoFeedback, match="corrupt feedback"):
        cell.arm.position()


def test_the_process_is_as_before_after_a_motion():
    before = gc.isenabled(), os.sched_getscheduler(0)
    with pytest.raises(KeyboardInterrupt), RealClock().undisturbed():
        assert not gc.isenabled()
        raise KeyboardInterrupt
    assert (gc.isenabled(), os.sched_getscheduler(0)) == before


def test_an_arm_needs_no_jax():
    code = "import sys, sainet.robots.wire.guidance; print(*sorted(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not {"jax", "google.protobuf"} & set(done.stdout.split())


def test_the_arm_pushes_disks_of_the_emulated_table():
    here = table(HOME)
    start = here.pose
    cell = Cell(carry=here.carry)
    low = HOME * [1, 1, 0] + [0, 0, 0.005]
    down, push = straight(HOME, low, 0.09), straight(low, low + AHEAD, 0.05)
    assert not cell.arm.follow(np.concatenate([down, push])).trouble
    # The disk is 60 mm ahead: its radius, the pusher's, and a gap of 2.7 mm.
    moved = (here.pose - start)[0]
    assert moved[0] == pytest.approx(0.04 - 0.0027, abs=5e-4)
    assert abs(moved[1]) < 1e-3


def test_faulty_pushes_on_the_simulated_clock():
    tally = run_simulated(40, seed=3, disks=False)
    assert not tally.violations and not tally.unasked
    assert tally.commands and max(tally.commands) < 3 * CYCLE
    assert tally.decisions == pytest.approx([3 * CYCLE] * len(tally.decisions))


def test_faulty_pushes_in_real_time():
    # A busy machine is late: such motions are stopped with a reason, too.
    tally = run_real(4, seed=2)
    assert not tally.violations
    assert all("no feedback" in reason for reason in tally.unasked)


def test_a_closed_arm_frees_its_port():
    transport = UdpTransport(controller=LOOPBACK, port=0)
    with EgmArm(transport, LIMITS):
        port = transport.port
    again = UdpTransport(controller=LOOPBACK, port=port)
    assert again.port == port
    again.close()
