"""Simulation of one push in PyBullet, free of JAX so that processes start quickly.

A disk is a cylinder on four small feet, two thirds of its radius from the centre, with
its centre of mass in the plane of the table. A bare cylinder touches a plane at points
on its rim that Bullet selects anew in every step: it tilts, rotates while it coasts,
and its friction varies with its heading by 9 %. The feet distribute the weight like a
uniform pressure; `docs/engine.md` compares both.
"""

import ctypes
import math
import os
import sys
import threading
from functools import lru_cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float


@lru_cache
def load_pybullet() -> Any:  # noqa: ANN401
    """Return the PyBullet module, imported on first use."""
    sys.stdout.flush()
    kept = [(os.dup(file), file) for file in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for _, file in kept:
            os.dup2(nowhere, file)
        module = import_module("pybullet")
        ctypes.CDLL(None).fflush(None)  # the banner is in C's output buffer
    finally:
        for copy, file in kept:
            os.dup2(copy, file)
            os.close(copy)
        os.close(nowhere)
    return module


GRAVITY = 9.81  # m/s^2
FEET = 4
FOOT_ARM = 2 / 3  # of the radius: the mean distance of a uniform pressure
_FOOT_RADIUS = 0.002  # m
_CLEARANCE = 0.0005  # m, between the table and the cylinder
_HEIGHT = 0.02  # m, of a disk
_GUIDED_MASS = 1000.0  # kg: contacts do not slow a pusher that follows a path
_PUSHABLE = 1  # collision group of disks and pusher; each table plane has its own
_NEVER_SLEEPS = 2  # pybullet.ACTIVATION_STATE_DISABLE_SLEEPING


class Job(NamedTuple):
    """Numbers that define one push."""

    mass: Float[np.ndarray, " body"]
    radius: Float[np.ndarray, " body"]
    table_friction: float
    disk_friction: float
    pusher_friction: float
    pusher_radius: float
    motion: Float[np.ndarray, "body 6"]
    pusher: Float[np.ndarray, " 4"]  # position and velocity
    command: Float[np.ndarray, "time 2"]  # positions (m) or forces (N)
    field: tuple[np.ndarray, np.ndarray, float] | None  # wave, phase, amplitude
    pusher_mass: float  # kg; infinite: it follows a path, and contacts do not slow it
    damping: float  # N s/m, of a pusher that a force drives
    time_step: float

    @property
    def is_guided(self) -> bool:
        """Whether the pusher follows a path."""
        return math.isinf(self.pusher_mass)


class Moved(NamedTuple):
    """States of disks and pusher after each step."""

    motion: Float[np.ndarray, "time body 6"]
    pusher: Float[np.ndarray, "time 4"]


class World:
    """PyBullet client that is created once and emptied before each push.

    Bullet keeps contacts and their impulses from step to step. An empty world has
    neither, so the result of a push does not depend on earlier pushes.
    """

    def __init__(self) -> None:
        """Connect to PyBullet in DIRECT mode."""
        self._bullet = load_pybullet()
        self._client = self._bullet.connect(self._bullet.DIRECT)

    def roll(self, job: Job) -> Moved:
        """Return the states of one push after each step."""
        self._build(job)
        count, steps = len(job.mass), len(job.command)
        motion = np.empty((steps + 1, count, 6))
        pusher = np.empty((steps + 1, 4))
        motion[0], pusher[0] = job.motion, job.pusher
        for step in range(steps):
            self._vary_friction(job, motion[step])
            self._drive(job, pusher[step], job.command[step])
            self._bullet.stepSimulation(self._client)
            motion[step + 1] = self._disks(motion[step], job.time_step)
            pusher[step + 1] = self._pusher_after(pusher[step], job.time_step)
        return Moved(motion[1:], pusher[1:])

    def _build(self, job: Job) -> None:
        client = self._client
        self._bullet.resetSimulation(client)
        self._bullet.setPhysicsEngineParameter(
            fixedTimeStep=job.time_step,
            enableConeFriction=1,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        self._bullet.setGravity(0, 0, -GRAVITY, physicsClientId=client)
        # Bullet multiplies the coefficients of two surfaces.
        self._root = math.sqrt(max(job.disk_friction, 1e-12))
        indices = range(len(job.mass))
        self._tables = [self._add_table(job, index) for index in indices]
        self._bodies = [self._add_disk(job, index) for index in indices]
        self._pusher = self._add_pusher(job)

    def _add_table(self, job: Job, index: int) -> int:
        """Return a new plane that only one disk touches, with friction of its own."""
        client = self._client
        shape = self._bullet.createCollisionShape(
            self._bullet.GEOM_PLANE, physicsClientId=client
        )
        table = self._bullet.createMultiBody(0, shape, physicsClientId=client)
        self._set_surface(table, job.table_friction / self._root)
        self._meet(table, _own_group(index))
        return table

    def _add_disk(self, job: Job, index: int) -> int:
        mass, radius = float(job.mass[index]), float(job.radius[index])
        x, y, angle, vx, vy, spin = map(float, job.motion[index])
        inertia = mass * radius**2
        body = self._bullet.createMultiBody(
            mass,
            self._disk_shape(radius, angle),
            basePosition=[x, y, 0],
            baseOrientation=[0, 0, math.sin(angle / 2), math.cos(angle / 2)],
            physicsClientId=self._client,
        )
        self._set_surface(body, self._root, [inertia / 4, inertia / 4, inertia / 2])
        self._meet(body, _PUSHABLE | _own_group(index))
        self._bullet.resetBaseVelocity(body, [vx, vy, 0], [0, 0, spin], self._client)
        return body

    def _disk_shape(self, radius: float, angle: float) -> int:
        # Bullet applies friction along the axes of the table. Only for a foot at 45
        # degrees to these axes does an impulse move the foot equally along both.
        turns = [2 * math.pi * (foot + 0.5) / FEET - angle for foot in range(FEET)]
        arm = FOOT_ARM * radius
        feet = [[arm * math.cos(t), arm * math.sin(t), _FOOT_RADIUS] for t in turns]
        return self._bullet.createCollisionShapeArray(
            shapeTypes=[self._bullet.GEOM_CYLINDER] + [self._bullet.GEOM_SPHERE] * FEET,
            radii=[radius] + [_FOOT_RADIUS] * FEET,
            halfExtents=[[0, 0, 0]] * (1 + FEET),
            lengths=[_HEIGHT] + [0] * FEET,
            collisionFramePositions=[[0, 0, _CLEARANCE + _HEIGHT / 2], *feet],
            physicsClientId=self._client,
        )

    def _add_pusher(self, job: Job) -> int:
        client, (x, y, vx, vy) = self._client, map(float, job.pusher)
        shape = self._bullet.createCollisionShape(
            self._bullet.GEOM_CYLINDER,
            radius=float(job.pusher_radius),
            height=2 * _HEIGHT,
            physicsClientId=client,
        )
        mass = _GUIDED_MASS if job.is_guided else job.pusher_mass
        middle = [x, y, _CLEARANCE + _HEIGHT / 2]
        body = self._bullet.createMultiBody(
            mass, shape, basePosition=middle, physicsClientId=client
        )
        # Bullet never rotates a body with zero inertia.
        self._set_surface(body, job.pusher_friction / self._root, [0, 0, 0])
        self._meet(body, _PUSHABLE)
        self._bullet.resetBaseVelocity(body, [vx, vy, 0], [0, 0, 0], client)
        return body

    def _set_surface(
        self, body: int, friction: float, inertia: list[float] | None = None
    ) -> None:
        extra = {} if inertia is None else {"localInertiaDiagonal": inertia}
        self._bullet.changeDynamics(
            body,
            -1,
            lateralFriction=friction,
            rollingFriction=0,
            spinningFriction=0,
            restitution=0,
            linearDamping=0,
            angularDamping=0,
            activationState=_NEVER_SLEEPS,
            physicsClientId=self._client,
            **extra,
        )

    def _meet(self, body: int, groups: int) -> None:
        self._bullet.setCollisionFilterGroupMask(body, -1, groups, groups, self._client)

    def _vary_friction(self, job: Job, motion: np.ndarray) -> None:
        if job.field is None:
            return
        wave, phase, amplitude = job.field
        waves = np.cos(motion[:, 0:2] @ wave.T + phase).sum(axis=1)
        for table, factor in zip(self._tables, 1 + amplitude * waves, strict=True):
            friction = job.table_friction * max(factor, 0.1) / self._root
            self._bullet.changeDynamics(
                table, -1, lateralFriction=friction, physicsClientId=self._client
            )

    def _drive(self, job: Job, pusher: np.ndarray, command: np.ndarray) -> None:
        """Apply the command and cancel gravity: no plane supports the pusher."""
        body, client = self._pusher, self._client
        if job.is_guided:
            vx, vy = (command - pusher[0:2]) / job.time_step
            lift = GRAVITY * job.time_step
            self._bullet.resetBaseVelocity(body, [vx, vy, lift], [0, 0, 0], client)
            return
        fx, fy = command - job.damping * pusher[2:4]
        force = [fx, fy, job.pusher_mass * GRAVITY]
        self._bullet.applyExternalForce(
            body, -1, force, [0, 0, 0], self._bullet.LINK_FRAME, physicsClientId=client
        )

    def _disks(self, before: np.ndarray, time_step: float) -> np.ndarray:
        """Return the packed motion; velocities are differences of poses."""
        after = np.empty_like(before)
        for row, (body, old) in enumerate(zip(self._bodies, before, strict=True)):
            (x, y, _), turn = self._bullet.getBasePositionAndOrientation(
                body, self._client
            )
            angle = old[2] + math.remainder(_yaw(turn) - old[2], 2 * math.pi)
            after[row, 0:3] = x, y, angle
        after[:, 3:6] = (after[:, 0:3] - before[:, 0:3]) / time_step
        return after

    def _pusher_after(self, before: np.ndarray, time_step: float) -> np.ndarray:
        (x, y, _), _ = self._bullet.getBasePositionAndOrientation(
            self._pusher, self._client
        )
        return np.array(
            [x, y, (x - before[0]) / time_step, (y - before[1]) / time_step]
        )


def _own_group(index: int) -> int:
    return 2 << index


def _yaw(turn: tuple[float, float, float, float]) -> float:
    x, y, z, w = turn
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


_lock = threading.Lock()
_world: World | None = None


def roll_jobs(jobs: list[Job]) -> Moved:
    """Return the stacked motion (float32) of pushes simulated in this process."""
    global _world  # noqa: PLW0603
    with _lock:  # PyBullet is not thread-safe
        _world = _world or World()
        moved = [_world.roll(job) for job in jobs]
    stacked = (np.stack(parts).astype(np.float32) for parts in zip(*moved, strict=True))
    return Moved(*stacked)
