"""An emulated ABB controller: the bytes of EGM, an arm with lag, faults on demand.

Messages are made and read by `ABBRobotEGM`, an implementation that is not ours.
"""

import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np
from ABBRobotEGM.egm import egm_pb2

from robots.wire.simulated_clock import SimulatedClock
from sainet.robots.wire.limits import CYCLE, Stopped
from sainet.robots.wire.transport import AbstractTransport

FLIGHT = 0.0003  # s, of a datagram
MOTORS, EGM, RAPID = (
    egm_pb2.EgmMotorState,
    egm_pb2.EgmMCIState,
    egm_pb2.EgmRapidCtrlExecState,
)


class Kind(Enum):
    """What goes wrong."""

    LOSE = "messages are lost"
    SILENCE = "the controller sends nothing more"
    DELAY = "one message is delayed, later ones overtake it"
    STALL = "all messages from then on are delayed"
    REPEAT = "a message is sent twice"
    REORDER = "two messages change places"
    OLD = "an old message arrives again"
    BUNCH = "two messages are held up and arrive close together"
    FLOOD = "messages arrive without a pause"
    BACKWARD = "the controller's clock goes backwards"
    TRUNCATE = "half of a message arrives"
    NOISE = "random bytes arrive"
    NAN = "a coordinate is NaN"
    EMPTY = "a message has no Cartesian position"
    FREEZE = "the reported position does not change"
    JUMP = "the reported position jumps"
    PUSHED = "something pushes the arm off its path"
    DEAF = "answers are lost from then on"
    MOTORS = "the motors are switched off"
    EGM = "EGM stops"
    RAPID = "the RAPID program stops"
    STRANGER = "another process sends a message"
    HICCUP = "this program is held up"


class Fault(NamedTuple):
    """A fault of a kind, after a number of answers."""

    kind: Kind
    after: int  # answers
    size: int = 1  # cycles, or messages

    @property
    def harmless(self) -> bool:
        """Whether a motion may go on: feedback that is late, but not too late."""
        short = {Kind.HICCUP: 2, Kind.DELAY: 1, Kind.BUNCH: math.inf}
        return self.size <= short.get(self.kind, 0)


class Answer(NamedTuple):
    """A command, as the controller received it."""

    time: float  # s
    position: tuple[float, float, float]  # m
    number: int


class Datagram(NamedTuple):
    """Bytes on their way to the arm."""

    time: float  # s, of arrival
    order: int
    data: bytes
    stranger: bool = False


def as_m(pose) -> tuple[float, float, float]:
    return pose.pos.x / 1000, pose.pos.y / 1000, pose.pos.z / 1000


@dataclass
class EmulatedController:
    """An arm that follows the last answer with dead time and a first-order lag."""

    place: np.ndarray  # m, of the tool
    fault: Fault | None = None
    lag: float = 0.015  # s, time constant
    dead: int = 2  # cycles
    sequence: int = 0
    stamp: float = 0.0  # ms, of its clock at the start
    carry: Callable[[np.ndarray], None] = lambda tool: None  # called every cycle
    seed: int = 0

    cycle: int = 0
    answers: list[Answer] = field(default_factory=list)
    used: list[np.ndarray] = field(default_factory=list)  # m, target in each cycle
    places: list[np.ndarray] = field(default_factory=list)
    faulty: float = math.nan  # s, when the first faulty message was sent
    last_sent: float = math.nan  # s, when the last good message was sent

    def __post_init__(self) -> None:
        self.place = self._servo = np.array(self.place, float)
        self._shove = np.zeros(3)
        self._target: np.ndarray | None = None
        self._queue = [self.place] * self.dead
        self._reported = self.place
        self._held: bytes | None = None
        self._before = b""
        self._faults = 0
        self._random = np.random.default_rng(self.seed)

    def begin(self, fault: Fault | None) -> None:
        """Forget what happened, and prepare a fault."""
        self.fault = fault
        self.answers, self.used, self.places = [], [], []
        self.faulty = math.nan
        self._held, self._faults = None, 0
        self._shove = np.zeros(3)

    def take(self, data: bytes, time: float) -> None:
        """Receive an answer."""
        message = egm_pb2.EgmSensor()
        message.ParseFromString(data)
        assert message.header.mtype == egm_pb2.EgmHeader.MSGTYPE_CORRECTION
        position = as_m(message.planned.cartesian)
        self.answers.append(Answer(time, position, message.header.seqno))
        if not self._on(Kind.DEAF):
            self._target = np.array(position)

    def tick(self, time: float) -> list[tuple[float, bytes, bool]]:
        """Run one cycle.

        Returns:
            Messages: delay s, bytes, whether a stranger sends it.
        """
        self._move()
        self.cycle += 1
        self.sequence = (self.sequence + 1) % (1 << 32)
        good = self.message()
        sent = self._tampered(good)
        if self._on() and math.isnan(self.faulty):
            self.faulty = time
        elif not self._on():
            self.last_sent = time
        return sent

    def message(self) -> bytes:
        """Return this cycle's message."""
        robot = egm_pb2.EgmRobot()
        robot.header.seqno = self.sequence
        back = -5000.0 if self._on(Kind.BACKWARD) else 0.0
        stamp = self.stamp + back + 1000 * CYCLE * self.cycle
        robot.header.tm = int(stamp) % (1 << 32)
        robot.header.mtype = egm_pb2.EgmHeader.MSGTYPE_DATA
        robot.feedBack.joints.joints.extend([10.0, 20.0, 30.0, 40.0, 50.0, 60.0])
        if not self._on(Kind.EMPTY):
            self._fill(robot.feedBack.cartesian)
            self._fill(robot.planned.cartesian)
        off = self._on(Kind.MOTORS)
        robot.motorState.state = MOTORS.MOTORS_OFF if off else MOTORS.MOTORS_ON
        off = self._on(Kind.EGM)
        robot.mciState.state = EGM.MCI_STOPPED if off else EGM.MCI_RUNNING
        robot.mciConvergenceMet = False
        off = self._on(Kind.RAPID)
        state = RAPID.RAPID_STOPPED if off else RAPID.RAPID_RUNNING
        robot.rapidExecState.state = state
        robot.utilizationRate = 12.5
        return robot.SerializeToString()

    def _fill(self, pose) -> None:
        if not self._on(Kind.FREEZE):
            self._reported = self.place
        x, y, z = 1000 * self._reported
        if self._on(Kind.NAN):
            y = math.nan
        if self._on(Kind.JUMP):
            x += 20.0
        pose.pos.x, pose.pos.y, pose.pos.z = x, y, z
        turn = pose.orient
        turn.u0, turn.u1, turn.u2, turn.u3 = 0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0

    def _on(self, kind: Kind | None = None) -> bool:
        """Return whether the fault has begun, and is of a kind."""
        begun = self.fault is not None and len(self.answers) >= self.fault.after
        return begun and kind in (None, self.fault.kind)

    def _move(self) -> None:
        stopped = self._on(Kind.MOTORS) or self._on(Kind.EGM) or self._on(Kind.RAPID)
        if self._target is not None and not stopped:
            self.used.append(self._target)
            self._queue.append(self._target)
            aim = self._queue.pop(0)
            share = 1 - math.exp(-CYCLE / self.lag)
            self._servo = self._servo + share * (aim - self._servo)
        if self._on(Kind.PUSHED):
            self._shove = self._shove + np.array([0.0, 0.0005, 0.0])
        self.place = self._servo + self._shove
        self.places.append(self.place)
        self.carry(self.place)

    def _tampered(self, good: bytes) -> list[tuple[float, bytes, bool]]:
        """Return what is sent instead of a good message."""
        sent = [(0.0, good, False)]
        if not self._on():
            self._before = good
            return sent
        self._faults += 1
        first, size = self._faults == 1, self.fault.size
        sent = [(CYCLE * self._delay(), good, False)]
        match self.fault.kind:
            case Kind.SILENCE | Kind.LOSE if self._gone(size):
                sent = []
            case Kind.REPEAT if first:
                sent *= 1 + size
            case Kind.REORDER if first:
                self._held, sent = good, []
            case Kind.REORDER if self._faults == 2:
                sent.append((0.0, self._held or b"", False))
            case Kind.OLD if first:
                sent.append((0.0, self._before, False))
            case Kind.FLOOD if first:
                for _ in range(120):
                    self.sequence = (self.sequence + 1) % (1 << 32)
                    sent.append((0.0, self.message(), False))
            case Kind.TRUNCATE | Kind.NOISE if first:
                sent = [(0.0, self._spoiled(good), False)]
            case Kind.STRANGER if first:
                sent.insert(0, (0.0, good, True))
        return sent

    def _delay(self) -> float:
        """Return the delay of a message (cycles)."""
        match self.fault.kind:
            case Kind.DELAY if self._faults == 1:
                return self.fault.size
            case Kind.STALL:
                return self.fault.size + 2.5
            case Kind.BUNCH if self._faults <= 2:
                return 0.95 * (3 - self._faults)
        return 0.0

    def _gone(self, size: int) -> bool:
        return self.fault.kind is Kind.SILENCE or self._faults <= size

    def _spoiled(self, good: bytes) -> bytes:
        if self.fault.kind is Kind.TRUNCATE:
            return good[: len(good) // 2]
        return self._random.bytes(50 * self.fault.size)


class SimulatedLink(AbstractTransport):
    """Datagrams between an arm and an emulated controller on a simulated clock."""

    def __init__(self, controller: EmulatedController, clock: SimulatedClock) -> None:
        self._controller = controller
        self._clock = clock
        self._flying: list[Datagram] = []
        self._next = clock.now() + CYCLE
        self._count = 0
        self._held_up: Fault | None = None

    def receive(self, timeout: float) -> bytes | None:
        end = self._clock.now() + max(timeout, 0.0)
        while True:
            arrival = self._flying[0].time if self._flying else math.inf
            if min(arrival, self._next) > end:
                self._clock.advance_to(end)
                return None
            if arrival <= self._next:
                datagram = heapq.heappop(self._flying)
                self._clock.advance_to(datagram.time)
                self._hold_up()
                if datagram.stranger:
                    raise Stopped("feedback from another sender")
                return datagram.data
            self._tick()

    def send(self, data: bytes) -> None:
        self._controller.take(data, self._clock.now())

    def discard(self) -> None:
        now = self._clock.now()
        self._flying = [each for each in self._flying if each.time > now]

    def close(self) -> None:
        pass

    def idle(self, duration: float) -> None:
        """Let time (s) pass in which nobody reads."""
        end = self._clock.now() + duration
        while self._next <= end:
            self._tick()
        self._clock.advance_to(end)

    def _tick(self) -> None:
        # Time goes on where a program was held up.
        self._clock.advance_to(self._next)
        for delay, data, stranger in self._controller.tick(self._next):
            self._count += 1
            arrival = self._next + FLIGHT + delay
            heapq.heappush(self._flying, Datagram(arrival, self._count, data, stranger))
        self._next += CYCLE

    def _hold_up(self) -> None:
        fault = self._controller.fault
        if self._controller._on(Kind.HICCUP) and fault is not self._held_up:
            self._held_up = fault
            self.idle(fault.size * CYCLE)
