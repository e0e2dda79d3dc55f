"""Rigid disks on a table, pushed by an arm, in three dimensions with MuJoCo.

A disk rests on a few feet, each with the friction of the place and the direction in
which it slides. Its rim is a sphere about its centre: where rims and pusher touch, at
half the thickness, this is the circle of the disk. The pusher is carried by a body that
a critically damped position control moves.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from sainet.robots.lab.hidden import Lab
from sainet.runs.errors import missing_extra
from sainet.scenes.scene import PUSHER_RADIUS

TICK = 0.004  # s, between commands and between samples
_STEP = 0.001  # s, of the simulation
_HALF = 0.0065  # m, of the thickness
_FOOT = 0.002  # m, radius
_ARM_MASS = 5.0  # kg, moved with the pusher
_ARM = 2  # degrees of freedom before those of the disks
_FREE = 7  # position and quaternion of a disk
_TWIST = 6  # velocity and spin of a disk


@dataclass(frozen=True)
class Motion:
    """True motion after each tick."""

    pose: Float[np.ndarray, "push tick body 3"]  # m, m, rad
    pusher: Float[np.ndarray, "push tick 2"]  # m
    tilt: Float[np.ndarray, " push"]  # rad, the largest of any disk


class Mechanics:
    """Simulates pushes of one lab, several at once."""

    def __init__(self, lab: Lab, pushes: int = 1) -> None:
        """Compile the model.

        Raises:
            MissingExtra: MuJoCo is not installed.
        """
        self._lab, self._pushes = lab, pushes
        try:
            import mujoco
            from mujoco.batch import Batch
        except ImportError:
            raise missing_extra("The virtual lab needs MuJoCo", "mujoco") from None
        # MuJoCo's stubs do not name this class.
        model: Any = mujoco.MjModel.from_xml_string(  # pyright: ignore[reportAttributeAccessIssue]
            _xml(lab)
        )
        self._batch = Batch(model, nsim=pushes)
        self._feet = [
            [model.geom(f"foot {disk} {foot}").id for foot in range(len(each.feet))]
            for disk, each in enumerate(lab.disks)
        ]
        self._pusher = model.geom("pusher").id

    def run(
        self,
        pose: Float[np.ndarray, "push body 3"],
        path: Float[np.ndarray, "push tick 2"],
        friction: Float[np.ndarray, " push"],
    ) -> Motion:
        """Return the motion of disks at rest while the arm follows its commands.

        Args:
            pose: of the disks (m, m, rad), in the robot's frame.
            path: commanded position of the pusher (m), which starts at the first.
            friction: between pusher and disks, for each push.
        """
        batch = self._batch
        batch.reset()
        command: Any = batch.bind("ctrl")
        self._friction[:, self._pusher, 0] = friction
        self._place(pose, path[:, 0])
        poses, pushers, tilt = [], [], np.zeros(len(path))
        for tick in range(path.shape[1]):
            command[:] = path[:, tick]
            self._rub()
            batch.step(nstep=round(TICK / _STEP))
            poses.append(self._pose)
            pushers.append(self._position[:, :_ARM].copy())
            tilt = np.maximum(tilt, self._tilt)
        found = np.stack([pose, *poses], 1)
        # Poses between ticks are interpolated, also where the angle passes half a turn.
        found[..., 2] = np.unwrap(found[..., 2], axis=1)
        return Motion(found[:, 1:], np.stack(pushers, 1), tilt)

    @property
    def _position(self) -> Float[np.ndarray, "push coordinate"]:
        return np.asarray(self._batch.bind("qpos"))

    @property
    def _friction(self) -> Float[np.ndarray, "push geom 3"]:
        return np.asarray(self._batch.expand("geom_friction"))

    @property
    def _free(self) -> Float[np.ndarray, "push body 7"]:
        return self._position[:, _ARM:].reshape(self._pushes, -1, _FREE)

    @property
    def _pose(self) -> Float[np.ndarray, "push body 3"]:
        place, (w, x, y, z) = (
            self._free[..., :2],
            np.moveaxis(self._free[..., 3:], -1, 0),
        )
        angle = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))
        return np.concatenate([place, angle[..., None]], -1)

    @property
    def _tilt(self) -> Float[np.ndarray, " push"]:
        x, y = self._free[..., 4], self._free[..., 5]
        return np.arccos(np.clip(1 - 2 * (x**2 + y**2), -1, 1)).max(-1)

    def _place(
        self,
        pose: Float[np.ndarray, "push body 3"],
        pusher: Float[np.ndarray, "push 2"],
    ) -> None:
        half = pose[..., 2] / 2
        free = np.zeros((*pose.shape[:2], _FREE))
        free[..., :2], free[..., 2] = pose[..., :2], _HALF
        free[..., 3], free[..., 6] = np.cos(half), np.sin(half)
        self._position[:, :_ARM] = pusher
        self._position[:, _ARM:] = free.reshape(len(pose), -1)

    def _rub(self) -> None:
        """Give each foot the friction of its place and its direction of sliding."""
        twist: Any = self._batch.bind("qvel")[:, _ARM:]
        twist = twist.reshape(self._pushes, -1, _TWIST)
        pose, table = self._pose, self._lab.table
        for disk, (geoms, each) in enumerate(
            zip(self._feet, self._lab.disks, strict=True)
        ):
            angle, spin = pose[:, disk, 2], twist[:, disk, 5]
            cos, sin = np.cos(angle), np.sin(angle)
            turn = np.moveaxis(np.array([[cos, -sin], [sin, cos]]), -1, 0)
            arm = np.einsum("pij,fj->pfi", turn, each.feet)
            around = np.stack([-arm[..., 1], arm[..., 0]], -1)
            velocity = twist[:, disk, None, :2] + spin[:, None, None] * around
            place = pose[:, disk, None, :2] + arm
            self._friction[:, geoms, 0] = table.friction_at(place, velocity)


def _xml(lab: Lab) -> str:
    rate = 2 * np.pi * lab.arm.frequency
    control = f'kp="{_ARM_MASS * rate**2}" kv="{2 * _ARM_MASS * rate}"'
    soft = 'solref="0.004 1" solimp="0.95 0.99 0.0002" condim="3"'
    hard = 'solref="0.003 1" solimp="0.98 0.999 0.0002" condim="3"'
    disks = "".join(
        _disk_xml(lab, number, soft, hard) for number in range(len(lab.disks))
    )
    return f"""<mujoco>
<option timestep="{_STEP}" cone="elliptic" impratio="30" solver="Newton"
  tolerance="1e-10" iterations="50" noslip_iterations="4" integrator="implicitfast"/>
<worldbody>
  <geom name="table" type="plane" size="2 2 0.1" contype="4" conaffinity="2" {soft}/>
  <body name="pusher" pos="0 0 {_HALF}">
    <joint name="x" type="slide" axis="1 0 0"/>
    <joint name="y" type="slide" axis="0 1 0"/>
    <inertial pos="0 0 0" mass="{_ARM_MASS}" diaginertia="1 1 1"/>
    <geom name="pusher" type="capsule" size="{PUSHER_RADIUS} 0.03" priority="2" {hard}/>
  </body>
  {disks}
</worldbody>
<actuator>
  <position joint="x" {control}/>
  <position joint="y" {control}/>
</actuator>
</mujoco>"""


def _disk_xml(lab: Lab, number: int, soft: str, hard: str) -> str:
    disk = lab.disks[number]
    spin = disk.mass * disk.radius**2 / 2
    tip = disk.mass * (3 * disk.radius**2 + (2 * _HALF) ** 2) / 12
    feet = "".join(
        f'<geom name="foot {number} {foot}" type="sphere" size="{_FOOT}" '
        f'pos="{x} {y} {_FOOT - _HALF}" contype="2" conaffinity="4" priority="1" '
        f"{soft}/>"
        for foot, (x, y) in enumerate(disk.feet)
    )
    # Distinct places, so that no two bodies overlap when the model is compiled.
    return f"""<body name="disk {number}" pos="{1 + number} 0 {_HALF}"><freejoint/>
    <inertial pos="0 0 0" mass="{disk.mass}" diaginertia="{tip} {tip} {spin}"/>
    <geom name="disk {number}" type="sphere" size="{disk.radius}"
      friction="{lab.disk_friction} 0 0" {hard}/>{feet}</body>"""
