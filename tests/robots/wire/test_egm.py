import math
import subprocess
import sys

import numpy as np
import pytest
from ABBRobotEGM.egm import EGM, egm_pb2

from robots.wire.emulated_controller import EmulatedController, Fault, Kind
from sainet.robots.wire.egm import decode_feedback, encode_command
from sainet.robots.wire.limits import Stopped
from sainet.runs.errors import MissingExtra

PLACE = np.array([0.5123, -0.0456, 0.0789])  # m
TURN = (0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0)


def flat(message, prefix="") -> dict[str, object]:
    """Every field that is set, by its path."""
    found: dict[str, object] = {}
    for each, value in message.ListFields():
        if each.message_type is None:
            found[prefix + each.name] = value
        else:
            found |= flat(value, f"{prefix}{each.name}.")
    return found


def test_our_commands_read_by_another_implementation():
    message = egm_pb2.EgmSensor()
    message.ParseFromString(encode_command(7, 1234, PLACE, TURN))
    assert message.IsInitialized()
    assert flat(message) == {
        "header.seqno": 7,
        "header.tm": 1234,
        "header.mtype": egm_pb2.EgmHeader.MSGTYPE_CORRECTION,
        "planned.cartesian.pos.x": pytest.approx(512.3, abs=1e-9),
        "planned.cartesian.pos.y": pytest.approx(-45.6, abs=1e-9),
        "planned.cartesian.pos.z": pytest.approx(78.9, abs=1e-9),
        "planned.cartesian.orient.u0": TURN[0],
        "planned.cartesian.orient.u1": TURN[1],
        "planned.cartesian.orient.u2": TURN[2],
        "planned.cartesian.orient.u3": TURN[3],
    }


def test_our_commands_are_those_of_another_implementation():
    client = EGM(0)
    try:
        theirs = client._create_sensor_message_cart(
            1000 * PLACE, np.array(TURN), *[None] * 5
        )
    finally:
        client.close()
    theirs.header.tm, theirs.header.seqno = 1234, 7
    ours = egm_pb2.EgmSensor()
    ours.ParseFromString(encode_command(7, 1234, PLACE, TURN))
    assert flat(ours) == flat(theirs)


SECOND = """
import sys
from abb_robot_client.egm import egm_pb2
command = egm_pb2.EgmSensor()
command.ParseFromString(bytes.fromhex(sys.argv[1]))
p, q = command.planned.cartesian.pos, command.planned.cartesian.orient
h = command.header
print(h.seqno, h.tm, h.mtype, p.x, p.y, p.z, q.u0, q.u1, q.u2, q.u3)
robot = egm_pb2.EgmRobot()
robot.header.seqno, robot.header.tm, robot.header.mtype = 4294967295, 99, 2
pose = robot.feedBack.cartesian
pose.pos.x, pose.pos.y, pose.pos.z = 1.5, -2.5, 3.5
pose.orient.u0, pose.orient.u1, pose.orient.u2, pose.orient.u3 = 1, 0, 0, 0
robot.feedBack.joints.joints.extend([1, 2, 3, 4, 5, 6])
robot.feedBack.time.sec, robot.feedBack.time.usec = 5, 6
robot.motorState.state, robot.mciState.state, robot.rapidExecState.state = 1, 3, 2
robot.testSignals.signals.extend([1.0, 2.0])
robot.measuredForce.force.extend([1.0])
robot.RAPIDfromRobot.dnum.extend([4.0])
print(robot.SerializeToString().hex())
"""


def test_a_second_implementation_reads_ours_and_is_read():
    # In a process of its own: both packages register one file of messages.
    ours = encode_command(4_294_967_296 + 3, 1234, PLACE, TURN).hex()
    done = subprocess.run(
        [sys.executable, "-c", SECOND, ours], capture_output=True, text=True, check=True
    )
    command, feedback = done.stdout.splitlines()
    numbers = [float(each) for each in command.split()]
    assert numbers == pytest.approx([3, 1234, 3, 512.3, -45.6, 78.9, *TURN])
    read = decode_feedback(bytes.fromhex(feedback))
    assert (read.sequence, read.stamp, read.idle) == (4_294_967_295, 99, "")
    np.testing.assert_allclose(read.position, [0.0015, -0.0025, 0.0035], rtol=1e-12)
    assert read.orientation == (1.0, 0.0, 0.0, 0.0)


def message(fault: Kind | None = None) -> bytes:
    controller = EmulatedController(PLACE, fault and Fault(fault, 0))
    controller.sequence, controller.cycle = 41, 10
    return controller.message()


def test_their_feedback_read_by_us():
    feedback = decode_feedback(message())
    assert (feedback.sequence, feedback.stamp, feedback.idle) == (41, 40, "")
    np.testing.assert_allclose(feedback.position, PLACE, rtol=1e-12)
    assert feedback.orientation == TURN


@pytest.mark.parametrize(
    ("kind", "why"),
    [
        (Kind.MOTORS, "the motors are off"),
        (Kind.RAPID, "the RAPID program is stopped"),
        (Kind.EGM, "EGM is not running (state 2)"),
    ],
)
def test_feedback_of_a_controller_that_does_not_move(kind: Kind, why: str):
    assert decode_feedback(message(kind)).idle == why


def test_rapid_is_undefined_after_a_restart_although_it_runs():
    robot = egm_pb2.EgmRobot.FromString(message())
    robot.rapidExecState.state = egm_pb2.EgmRapidCtrlExecState.RAPID_UNDEFINED
    assert not decode_feedback(robot.SerializeToString()).idle


def without(name: str) -> bytes:
    robot = egm_pb2.EgmRobot.FromString(message())
    robot.ClearField(name)
    return robot.SerializeToString()


def turned(**turn: float) -> bytes:
    robot = egm_pb2.EgmRobot.FromString(message())
    for name, value in turn.items():
        setattr(robot.feedBack.cartesian.orient, name, value)
    return robot.SerializeToString()


def far() -> bytes:
    robot = egm_pb2.EgmRobot.FromString(message())
    robot.feedBack.cartesian.pos.x = 1e7
    return robot.SerializeToString()


def partial() -> bytes:
    robot = egm_pb2.EgmRobot.FromString(message())
    robot.feedBack.cartesian.pos.ClearField("x")
    return robot.SerializePartialToString()


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"\xff\xff", "cannot be parsed"),
        (message()[:40], "cannot be parsed"),
        (b"", "fields are missing"),
        (without("header"), "fields are missing"),
        (without("motorState"), "motors are off"),
        (without("mciState"), "EGM is not running"),
        (without("feedBack"), "no Cartesian position"),
        (partial(), "fields are missing"),
        (message(Kind.EMPTY), "no Cartesian position"),
        (message(Kind.NAN), "nan"),
        (far(), "10000000"),
        (turned(u1=math.inf), "no unit quaternion"),
        (turned(u1=math.nan), "no unit quaternion"),
        (turned(u1=0.0), "no unit quaternion"),
        (encode_command(1, 2, PLACE, TURN), "fields are missing|motors are off"),
    ],
)
def test_corrupt_feedback(data: bytes, why: str):
    try:
        idle = decode_feedback(data).idle
    except Stopped as stopped:
        assert "corrupt feedback" in str(stopped)
        idle = str(stopped)
    assert any(each in idle for each in why.split("|"))


def test_random_bytes_never_crash():
    random = np.random.default_rng(0)
    good = message()
    for _ in range(2000):
        data = bytearray(good)
        for _ in range(random.integers(1, 6)):
            data[random.integers(len(data))] = random.integers(256)
        try:
            position = decode_feedback(bytes(data[: random.integers(1, 200)])).position
        except Stopped:
            continue
        assert np.isfinite(position).all()


def test_a_missing_package_is_one_line(monkeypatch):
    from sainet.robots.wire import egm

    egm._messages.cache_clear()
    monkeypatch.setitem(sys.modules, "google.protobuf", None)
    with pytest.raises(MissingExtra, match=r"pip install 'sainet\[robot\]'"):
        encode_command(1, 2, PLACE, TURN)
    egm._messages.cache_clear()
