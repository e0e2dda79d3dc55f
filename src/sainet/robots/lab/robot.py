"""The robot of a virtual lab, behind the interface of physical robots."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from sainet.robots import RobotConfig
from sainet.robots.base import AbstractRobot
from sainet.robots.lab.hidden import Lab, draw_lab
from sainet.robots.lab.mechanics import TICK, Mechanics, Motion
from sainet.scenes.pushes import Push, check_push, place_pusher, push_direction
from sainet.scenes.recording import Conditions, Recording
from sainet.scenes.scene import PUSHER_RADIUS, Scene, pusher_gaps
from sainet.scenes.state import State, at_rest, in_a_row, poses_of

CLEARANCE = 0.003  # m, between the pusher and disk 1 when it has descended
_APPROACH = 0.03  # m/s
_WAIT = 0.15  # s, before the push, so that the arm has arrived
_HOLD = 0.5  # s, after the push, so that the disks come to rest
_FRAMES = 10  # of motion capture, whose mean is an observation
_TILT = np.deg2rad(5)
_PLACED = (5e-4, np.deg2rad(1))  # m, rad: standard deviation of a person's hand
_THERE = 1e-6  # m, rad: rounding of a pose where a disk is already
_TOUCHING = 1e-3  # m: disks that are meant to touch are closer than this
_LOOSE = 2e-4  # m: largest gap of disks that a person pushed together
_GENERATOR = 0x1ABF0


class LabRobot(AbstractRobot):
    """Executes pushes in a virtual lab and observes them by motion capture.

    The tracker's frame is the table frame. The robot assumes that its own is the same:
    the difference is one of the lab's hidden errors.
    """

    def __init__(
        self, lab: Lab, state: State, *, seed: int | Sequence[int] = 0
    ) -> None:
        """Put the disks on the table.

        Args:
            lab: with all hidden parameters.
            state: where a person puts the disks, as `arrange`.
            seed: of noise, equal seeds give equal recordings.

        Raises:
            MissingExtra: MuJoCo is not installed.
        """
        self._lab = lab
        self._mechanics = Mechanics(lab)
        self._rng = _generator(lab, *np.atleast_1d(seed).tolist())
        self._pose = np.zeros((len(lab.disks), 3))  # in the robot's frame
        self._measured: State | None = None  # since the disks were put there
        self.arrange(state)

    @property
    def scene(self) -> Scene:
        """Masses and radii as people can measure them, and usual frictions."""
        disks = self._lab.disks
        return Scene.disks(
            [disk.mass for disk in disks],
            [disk.radius for disk in disks],
            pusher_radius=PUSHER_RADIUS,
        )

    @property
    def truth(self) -> State:
        """Poses in the table frame without noise."""
        return _state(self._lab.capture.seen(self._pose))

    def arrange(self, state: State) -> None:
        """Have a person put the disks there, who pushes those together that touch.

        Disks that are there already stay as they are.
        """
        rng, (place, angle) = self._rng, _PLACED
        wanted = poses_of(state)
        stay = np.all(np.abs(wanted - poses_of(self.truth)) <= _THERE, axis=-1)
        off = rng.standard_normal(wanted.shape) * [place, place, angle]
        pose = wanted + np.where(stay[:, None], 0, off)
        radii = [disk.radius for disk in self._lab.disks]
        for i in range(1, len(pose)):
            for j in range(i):
                reach = radii[i] + radii[j]
                apart = np.linalg.norm(wanted[i, :2] - wanted[j, :2])
                between = pose[i, :2] - pose[j, :2]
                distance = float(np.linalg.norm(between))
                touch = abs(apart - reach) < _TOUCHING or distance < reach
                if touch and not (stay[i] and stay[j]):
                    exact = reach + rng.uniform(0, _LOOSE)
                    pose[i, :2] = pose[j, :2] + between * exact / distance
        self._pose, self._measured = self._lab.capture.unseen(pose), None

    def resume(self, left: State | None, *seed: int) -> None:
        """Put the disks back where a push left them, and draw noise anew."""
        self._rng = _generator(self._lab, *seed)
        if left is not None:
            pose = poses_of(left).astype(np.float64)
            self._pose, self._measured = self._lab.capture.unseen(pose), None

    def observe(self) -> State:
        """Return the measured poses: the mean of a few frames."""
        frames = np.repeat(self._pose[None], _FRAMES, 0)
        found = _state(self._lab.capture.measured(self._rng, frames).mean(0))
        self._measured = found
        return found

    def push(self, push: Push) -> Recording:
        """Approach disk 1 along its normal, wait, push and hold.

        The recording begins after the approach.
        """
        check_push(push)
        state = self._measured or self.observe()
        start, normal, heading = self._plan(state, push)
        if trouble := self._blocked(state, start - CLEARANCE * normal):
            still = self._lab.capture.measured(self._rng, self._pose[None])
            return self._kept(push, np.zeros(1), still, start[None], trouble)
        before = start + np.multiply.outer(approach() - CLEARANCE, normal)
        length, speed = float(push.length), float(push.speed)
        stroke = np.minimum(speed * _ticks(length / speed + _HOLD), length)
        command = np.concatenate([before, start + np.multiply.outer(stroke, heading)])
        motion = self._move(command)
        self._pose = motion.pose[0, -1]
        return self._recording(push, motion, len(before))

    def _plan(self, state: State, push: Push) -> tuple[np.ndarray, ...]:
        """Return the pusher's start, the contact normal and the push direction."""
        scene, state, push = jax.tree.map(jnp.asarray, (self.scene, state, push))
        start = np.asarray(place_pusher(scene, state, push), np.float64)
        normal = np.asarray(state.position[0], np.float64) - start
        heading = np.asarray(push_direction(state, push), np.float64)
        return start, normal / np.linalg.norm(normal), heading

    def _blocked(self, state: State, place: Float[np.ndarray, " 2"]) -> str:
        """Return which disk the pusher would descend on; empty: none."""
        state = at_rest(state.position, state.angle, jnp.asarray(place, jnp.float32))
        gaps = np.asarray(pusher_gaps(self.scene, state))
        if gaps.min() > 0:
            return ""
        return f"the pusher would descend on disk {1 + int(gaps.argmin())}"

    def _move(self, command: Float[np.ndarray, "tick 2"]) -> Motion:
        """Move the arm along its commands, late and beside them."""
        lab, rng = self._lab, self._rng
        late = np.arange(len(command)) - round(lab.arm.delay / TICK)
        path = command[np.maximum(late, 0)] + lab.arm.error * rng.standard_normal(2)
        friction = lab.friction_of_push(rng, self._pose[0], path[0])
        return self._mechanics.run(self._pose[None], path[None], np.array([friction]))

    def _recording(self, push: Push, motion: Motion, begin: int) -> Recording:
        """Return what robot and tracker recorded, each at its own times."""
        capture = self._lab.capture
        clock = TICK * (np.arange(motion.pose.shape[1]) - begin)
        first = self._rng.uniform(0, 1 / capture.rate)
        frames = np.append(0, np.arange(first, clock[-1], 1 / capture.rate) + TICK / 8)
        true = motion.pose[0].reshape(len(clock), -1).T
        seen = np.stack([np.interp(frames - capture.delay, clock, x) for x in true], -1)
        moving = clock >= 0
        time = np.union1d(clock[moving], frames)
        pose = np.full((len(time), len(self._pose), 3), np.nan)
        pose[np.searchsorted(time, frames)] = self._lab.capture.measured(
            self._rng, seen.reshape(len(frames), -1, 3)
        )
        pusher = np.full((len(time), 2), np.nan)
        pusher[np.searchsorted(time, clock[moving])] = motion.pusher[0, moving]
        trouble = "" if motion.tilt[0] < _TILT else "a disk tilted"
        return self._kept(push, time, pose, pusher, trouble)

    def _kept(
        self,
        push: Push,
        time: Float[np.ndarray, " sample"],
        pose: Float[np.ndarray, "sample body 3"],
        pusher: Float[np.ndarray, "sample 2"],
        trouble: str,
    ) -> Recording:
        speed = 1000 * float(push.speed)
        return Recording(
            time=time,
            pose=pose,
            pusher=pusher,
            commanded=push,
            conditions=Conditions(surface=self._lab.surface, speed_mm_s=speed),
            trouble=trouble,
        )


def approach() -> Float[np.ndarray, " tick"]:
    """Return how far the pusher has come from its clearance (m); then it waits."""
    return np.minimum(_APPROACH * _ticks(CLEARANCE / _APPROACH + _WAIT), CLEARANCE)


def lab_robot(config: RobotConfig, *seed: int) -> LabRobot:
    """Return the robot of a virtual lab, its disks in a row."""
    order = (1, 0) if config.swapped else (0, 1)
    lab = draw_lab(config.lab, config.surface, order=order)
    row = in_a_row(np.array([disk.radius for disk in lab.disks]))
    return LabRobot(lab, row, seed=seed)


def _generator(lab: Lab, *seed: int) -> np.random.Generator:
    return np.random.default_rng([_GENERATOR, lab.number, *seed])


def _ticks(duration: float) -> Float[np.ndarray, " tick"]:
    """Return the times at the ends of all ticks of a duration (s)."""
    return TICK * np.arange(1, int(np.ceil(duration / TICK)) + 1)


def _state(pose: Float[np.ndarray, "body 3"]) -> State:
    single = jnp.asarray(pose, jnp.float32)
    return at_rest(single[:, :2], single[:, 2], jnp.zeros(2, jnp.float32))
