"""Pushes with injected faults, and the check of what an emulated controller received.

The check looks at the answers that arrived, not at the code under test. As a program,
from the folder tests/, it runs the full target:

    python -m robots.wire.faulty_pushes 10000 300
"""

import math
import re
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np

from robots.wire.emulated_controller import (
    EmulatedController,
    Fault,
    Kind,
    SimulatedLink,
)
from robots.wire.emulated_table import EmulatedTable
from robots.wire.real_controller import RealController, Report
from robots.wire.simulated_clock import SimulatedClock
from sainet.robots.wire.arm import AbstractArm, Stroke
from sainet.robots.wire.guidance import EgmArm
from sainet.robots.wire.limits import CYCLE, Limits
from sainet.robots.wire.transport import LOOPBACK, UdpTransport
from sainet.scenes.scene import Scene
from sainet.scenes.state import at_rest

LIMITS = Limits(low=(0.3, -0.2, 0.002), high=(0.7, 0.2, 0.05), speed=0.1, line=0.002)
HOME = np.array([0.5, 0.0, 0.03])  # m
MOST_CYCLES = 3  # from "feedback stopped" to "commands stopped"
CHAIN = 10  # pushes through one connection on the simulated clock

REASONS = {
    Kind.LOSE: "missing|no feedback",
    Kind.SILENCE: "no feedback",
    Kind.DELAY: "missing|no feedback",
    Kind.STALL: "no feedback",
    Kind.REPEAT: "repeated",
    Kind.REORDER: "missing|out of order",
    Kind.OLD: "out of order",
    Kind.BUNCH: "no feedback|missing",
    Kind.FLOOD: "arrived at once|frozen",
    Kind.BACKWARD: "out of order",
    Kind.TRUNCATE: "corrupt",
    Kind.NOISE: "corrupt",
    Kind.NAN: "corrupt.*nan",
    Kind.EMPTY: "corrupt",
    Kind.FREEZE: "frozen|off the commanded path",
    Kind.JUMP: "off the commanded path",
    Kind.PUSHED: "off the commanded path",
    Kind.DEAF: "off the commanded path|frozen",
    Kind.MOTORS: "motors are off",
    Kind.EGM: "EGM is not running",
    Kind.RAPID: "RAPID program is stopped",
    Kind.STRANGER: "another sender",
    Kind.HICCUP: "no feedback",
}
# The arm is compared with all that was commanded during its longest lag.
SLOW = {Kind.FREEZE, Kind.PUSHED, Kind.DEAF}
SLOWEST = LIMITS.lag_cycles + 40  # cycles


def table(start: np.ndarray) -> EmulatedTable:
    """A disk beside the tool."""
    scene = Scene.disks([0.9], [0.0525])
    place = jnp.array([[start[0] + 0.06, start[1]]])
    return EmulatedTable(scene, at_rest(place, jnp.zeros(1), jnp.array([9.0, 9.0])))


def disk_beneath(start: np.ndarray) -> Callable[[np.ndarray], None]:
    return table(start).carry


def straight(start: np.ndarray, end: np.ndarray, speed: float) -> np.ndarray:
    """Rows from one point (m) to another, without the first."""
    rows = max(1, math.ceil(np.linalg.norm(end - start) / (speed * CYCLE)))
    return np.linspace(start, end, rows + 1)[1:]


def push_path(random: np.random.Generator, start: np.ndarray) -> np.ndarray:
    """Descend, push towards the middle, hold and lift."""
    speed = random.uniform(0.02, 0.09)
    middle = np.array([0.5, 0.0, 0.0]) + [*random.uniform(-0.15, 0.15, 2), 0.0]
    aim = middle - start
    way = aim[:2] / max(np.linalg.norm(aim[:2]), 1e-6) * random.uniform(0.008, 0.02)
    low = np.array([start[0], start[1], random.uniform(0.005, 0.01)])
    end = low + [*way, 0.0]
    lifted = end + [0.0, 0.0, 0.03 - end[2]]
    down, push = straight(start, low, 0.09), straight(low, end, speed)
    hold = np.repeat(end[None], random.integers(0, 20), axis=0)
    return np.concatenate([down, push, hold, straight(end, lifted, 0.09)])


def draw_fault(
    random: np.random.Generator, rows: int, kinds: list[Kind]
) -> Fault | None:
    """A fault in nine of ten pushes, before the arm is nearly at the end."""
    if random.random() < 0.1:
        return None
    kind = kinds[random.integers(len(kinds))]
    last = rows - 40 if kind in SLOW else rows
    return Fault(kind, int(random.integers(1, last)), int(random.integers(1, 6)))


@dataclass
class Tally:
    """What was found in many pushes."""

    pushes: int = 0
    troubles: Counter = field(default_factory=Counter)  # by kind of fault
    violations: list[str] = field(default_factory=list)
    unasked: list[str] = field(default_factory=list)  # stopped without a fault
    # s, from the sending of the last good message to the last command, and, where
    # messages end, from its arrival to the end of the motion
    commands: list[float] = field(default_factory=list)
    decisions: list[float] = field(default_factory=list)
    real_time: bool = False  # a busy machine may be late

    def note(self, fault: Fault | None, path, stroke: Stroke, report, end: float):
        """Check one push; `end` is when the arm returned, s."""
        self.pushes += 1
        name = fault.kind.name if fault else "none"
        self.troubles[name] += 1
        found = list(problems(fault, path, stroke, report, self.real_time))
        self.violations += [f"push {self.pushes}, {fault}: {each}" for each in found]
        if stroke.trouble and math.isnan(report.faulty):
            self.unasked.append(stroke.trouble)
        elif fault and not fault.harmless and fault.kind not in SLOW:
            self.commands.append(report.answers[-1].time - report.last_sent)
            if fault.kind in (Kind.SILENCE, Kind.STALL):
                self.decisions.append(end - stroke.time[-1])


def problems(
    fault: Fault | None, path, stroke: Stroke, report, real_time: bool
) -> Iterator[str]:
    """What a controller received that it should not have."""
    answers = np.array([each.position for each in report.answers]).reshape(-1, 3)
    low, high = np.array(LIMITS.low), np.array(LIMITS.high)
    if ((answers < low - 1e-9) | (answers > high + 1e-9)).any():
        yield "a command outside the workspace"
    longest = LIMITS.speed * CYCLE * (1 + 1e-6)
    steps = np.linalg.norm(np.diff(answers, axis=0), axis=1)
    if (steps > longest).any():
        yield f"a step of {1000 * steps.max():.3f} mm between two answers"
    used = np.array(report.used).reshape(-1, 3)
    new = np.flatnonzero(np.any(np.diff(used, axis=0) != 0, axis=1)) + 1
    # On a busy machine, a command may miss its cycle and be used with the next.
    cycles = np.diff(new) if real_time else 1
    if (np.linalg.norm(np.diff(used[new], axis=0), axis=1) > longest * cycles).any():
        yield "a command that is too fast for its cycle"
    places = np.array(report.places)
    room = LIMITS.line + 0.001
    pushed = fault is not None and fault.kind is Kind.PUSHED
    if ((places < low - room) | (places > high + room)).any() and not pushed:
        yield "the arm left the workspace"
    numbers = [each.number for each in report.answers]
    if numbers != sorted(set(numbers)):
        yield "answers with repeated numbers"
    if not stroke.trouble:
        if fault is not None and not fault.harmless:
            yield "no recorded reason"
        elif np.linalg.norm(answers[-1] - path[-1]) > 1e-9:
            yield "the end of the path was not commanded"
        return
    if fault is None or math.isnan(report.faulty):
        return
    known = REASONS[fault.kind] + ("|no feedback" if real_time else "")
    if not re.search(known, stroke.trouble):
        yield f"another reason: {stroke.trouble}"
    if real_time:
        return
    after = (report.answers[-1].time - report.faulty) / CYCLE
    if after > (SLOWEST if fault.kind in SLOW else MOST_CYCLES):
        yield f"commands {after:.1f} cycles after the fault"


def run_simulated(pushes: int, seed: int, *, disks: bool = True) -> Tally:
    """Push on the simulated clock."""
    random = np.random.default_rng(seed)
    tally = Tally()
    for first in range(0, pushes, CHAIN):
        clock = SimulatedClock()
        controller = EmulatedController(
            HOME,
            lag=random.uniform(0.005, 0.02),
            dead=int(random.integers(0, 4)),
            sequence=(1 << 32) - int(random.integers(1, 2000)),
            stamp=float((1 << 32) - random.integers(1, 8000)),
            seed=first,
        )
        if disks:
            controller.carry = table(HOME).carry
        link = SimulatedLink(controller, clock)
        arm = EgmArm(link, LIMITS, clock)
        for _ in range(min(CHAIN, pushes - first)):
            controller.begin(None)
            path = push_path(random, arm.position())
            fault = draw_fault(random, len(path), list(Kind))
            controller.begin(fault)
            stroke = arm.follow(path)
            end = clock.now()
            count = len(controller.answers)
            link.idle(0.2)
            tally.note(fault, path, stroke, controller, end)
            assert len(controller.answers) == count
            # As an operator does: the fault is mended, the arm lifted.
            recover(controller, link, arm)
    return tally


def recover(controller, link: SimulatedLink | None, arm: AbstractArm) -> None:
    """Mend the fault and lift the arm."""
    controller.begin(None)
    if link is not None:
        link.idle(0.2)
    place = np.clip(arm.position(), LIMITS.low, LIMITS.high)
    top = np.array([place[0], place[1], HOME[2]])
    stroke = arm.follow(np.concatenate([place[None], straight(place, top, 0.09)]))
    assert link is None or not stroke.trouble, stroke.trouble


def run_real(pushes: int, seed: int, *, disks: bool = False) -> Tally:
    """Push over UDP, with the controller in a process of its own."""
    random = np.random.default_rng(seed)
    kinds = [kind for kind in Kind if kind is not Kind.HICCUP]
    tally = Tally(real_time=True)
    transport = UdpTransport(controller=LOOPBACK, port=0)
    beneath = disk_beneath if disks else None
    with (
        RealController(HOME, transport.port, beneath=beneath) as controller,
        EgmArm(transport, LIMITS) as arm,
    ):
        for _ in range(pushes):
            path = push_path(random, arm.position())
            fault = draw_fault(random, len(path), kinds)
            controller.begin(fault)
            stroke = arm.follow(path)
            end = time.monotonic()
            time.sleep(0.05)
            report: Report = controller.report()
            tally.note(fault, path, stroke, report, end)
            controller.begin(None)
            time.sleep(0.1)
            recover(controller, None, arm)
    return tally


def show(tally: Tally, seconds: float) -> None:
    """Print the figures."""
    kinds = ", ".join(f"{name} {n}" for name, n in sorted(tally.troubles.items()))
    print(f"{tally.pushes} pushes in {seconds:.0f} s: {kinds}")
    print(f"violations: {len(tally.violations)}")
    for each in tally.violations[:20]:
        print("  ", each)
    print(f"stopped without an injected fault: {len(tally.unasked)}")
    for each in tally.unasked[:5]:
        print("  ", each)
    print("from the last good feedback (ms; cycles)")
    ends = {"to the last command": tally.commands, "to the end": tally.decisions}
    for name, seconds_each in ends.items():
        if seconds_each:
            delays = np.percentile(seconds_each, [0, 50, 99.9, 100])
            ms = ", ".join(f"{1000 * delay:.3f}" for delay in delays)
            cycles = delays[-1] / CYCLE
            print(
                f"  {name}: least, median, 99.9th percentile and largest of "
                f"{len(seconds_each)}: {ms} ms ({cycles:.3f} cycles)"
            )


if __name__ == "__main__":
    for run, count in zip((run_simulated, run_real), sys.argv[1:], strict=False):
        begun = time.monotonic()
        show(run(int(count), seed=1), time.monotonic() - begun)
