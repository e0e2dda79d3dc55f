"""Messages of ABB's Externally Guided Motion (EGM): field numbers, units and states.

The controller sends `EgmRobot` and is answered with `EgmSensor`, both in protobuf
(proto2). Lengths are in millimetres, orientations unit quaternions, scalar first. Only
the fields that a Cartesian position needs are defined; a decoder skips all others.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from sainet.robots.wire.limits import COORDINATE, Stopped
from sainet.runs.errors import missing_extra

CORRECTION = 3  # message type: sent for position guidance
_MOTORS_ON, _RAPID_STOPPED, _EGM_RUNNING = 1, 1, 3
_UNIT = 1e-2  # largest deviation of a quaternion's squared norm from 1

# Field, number, kind; all double numbers and states are required. Enumerations are
# integers on the wire.
_FIELDS = {
    "EgmHeader": "seqno 1 uint32, tm 2 uint32, mtype 3 uint32",
    "EgmCartesian": "x 1 double, y 2 double, z 3 double",
    "EgmQuaternion": "u0 1 double, u1 2 double, u2 3 double, u3 4 double",
    "EgmPose": "pos 1 EgmCartesian, orient 2 EgmQuaternion",
    "EgmPlanned": "cartesian 2 EgmPose",
    "EgmState": "state 1 uint32",
    "EgmRobot": (
        "header 1 EgmHeader, feedBack 2 EgmPlanned, motorState 4 EgmState, "
        "mciState 5 EgmState, rapidExecState 8 EgmState"
    ),
    "EgmSensor": "header 1 EgmHeader, planned 2 EgmPlanned",
}

Quaternion = tuple[float, float, float, float]  # scalar first


@dataclass(frozen=True, slots=True)
class Feedback:
    """One message of the controller."""

    sequence: int
    stamp: int  # ms, of the controller's clock
    position: Float[np.ndarray, "3"]  # m, in the base frame
    orientation: Quaternion
    idle: str  # why no motion is executed; empty: motion is executed


def decode_feedback(data: bytes) -> Feedback:
    """Return the feedback in the bytes of an `EgmRobot`.

    Raises:
        Stopped: the bytes are no such message, or a number in it is impossible.
        MissingExtra: protobuf is not installed.
    """
    messages = _messages()
    message = messages.robot()
    try:
        message.ParseFromString(data)
    except messages.unreadable as cause:
        raise Stopped("corrupt feedback: it cannot be parsed") from cause
    if not (message.IsInitialized() and message.HasField("header")):
        raise Stopped("corrupt feedback: fields are missing")
    pose = message.feedBack.cartesian
    if not (pose.HasField("pos") and pose.HasField("orient")):
        raise Stopped("corrupt feedback: it has no Cartesian position")
    place = (pose.pos.x, pose.pos.y, pose.pos.z)
    turn = (pose.orient.u0, pose.orient.u1, pose.orient.u2, pose.orient.u3)
    if not all(abs(each) <= 1000 * COORDINATE.high for each in place):  # NaN as well
        raise Stopped(f"corrupt feedback: the position is {place} mm")
    if not abs(sum(each * each for each in turn) - 1) <= _UNIT:
        raise Stopped(f"corrupt feedback: the orientation {turn} is no unit quaternion")
    return Feedback(
        message.header.seqno,
        message.header.tm,
        np.array(place) / 1000,
        turn,
        _idle(message),
    )


def encode_command(
    sequence: int, stamp: int, position: Float[np.ndarray, "3"], orientation: Quaternion
) -> bytes:
    """Return the bytes of an `EgmSensor` with one position.

    Args:
        sequence: number of the message.
        stamp: time (ms).
        position: of the tool (m), in the base frame.
        orientation: of the tool.

    Raises:
        MissingExtra: protobuf is not installed.
    """
    message = _messages().sensor()
    header, pose = message.header, message.planned.cartesian
    header.seqno, header.tm = sequence & 0xFFFFFFFF, stamp & 0xFFFFFFFF
    header.mtype = CORRECTION
    pose.pos.x, pose.pos.y, pose.pos.z = (1000 * position).tolist()
    orient = pose.orient
    orient.u0, orient.u1, orient.u2, orient.u3 = orientation
    return message.SerializeToString()


class _Messages(NamedTuple):
    robot: Any  # class of the controller's messages
    sensor: Any  # class of the answers
    unreadable: type[Exception]


@cache
def _messages() -> _Messages:
    """Return the classes of messages, in a pool of descriptors of their own."""
    try:
        from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
        from google.protobuf.message import DecodeError
    except ImportError:
        raise missing_extra("EGM needs the package protobuf", "robot") from None
    kinds = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(name="sainet/egm.proto", package="egm")
    for name, fields in _FIELDS.items():
        message = file.message_type.add(name=name)
        for field in fields.split(", "):
            label, number, kind = field.split()
            scalar = {"uint32": kinds.TYPE_UINT32, "double": kinds.TYPE_DOUBLE}
            required = kind == "double" or label == "state"
            message.field.add(
                name=label,
                number=int(number),
                label=kinds.LABEL_REQUIRED if required else kinds.LABEL_OPTIONAL,
                type=scalar.get(kind, kinds.TYPE_MESSAGE),
                type_name=None if kind in scalar else f".egm.{kind}",
            )
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(file.SerializeToString())
    robot, sensor = (
        message_factory.GetMessageClass(pool.FindMessageTypeByName(f"egm.{name}"))
        for name in ("EgmRobot", "EgmSensor")
    )
    return _Messages(robot, sensor, DecodeError)


def _idle(message: Any) -> str:  # noqa: ANN401
    """Return why a controller executes no motion, empty if it does."""
    if message.motorState.state != _MOTORS_ON:
        return "the motors are off"
    # After a restart of the controller the state stays undefined while RAPID runs.
    if message.rapidExecState.state == _RAPID_STOPPED:
        return "the RAPID program is stopped"
    if message.mciState.state != _EGM_RUNNING:
        return f"EGM is not running (state {message.mciState.state})"
    return ""
