"""The planar engine's step once more: one scene, plain loops, double precision.

Written from the physics, slowly: vectors and impulses, a cross product for every
torque. It shares no code with the engine.
"""

from dataclasses import dataclass

import numpy as np

GRAVITY = 9.81
DT = 1 / 240


@dataclass
class Body:
    """A disk, or the pusher: it has no table under it and may be immovable."""

    radius: float
    mass: float
    position: np.ndarray
    velocity: np.ndarray
    angle: float = 0.0
    spin: float = 0.0
    on_table: bool = True

    def hit(self, impulse: np.ndarray, arm: np.ndarray):
        if np.isinf(self.mass):
            return
        self.velocity = self.velocity + impulse / self.mass
        if self.on_table:
            inertia = self.mass * self.radius**2 / 2
            self.spin += (arm[0] * impulse[1] - arm[1] * impulse[0]) / inertia

    def velocity_at(self, arm: np.ndarray) -> np.ndarray:
        return self.velocity + self.spin * np.array([-arm[1], arm[0]])

    def move(self):
        self.position = self.position + DT * self.velocity
        self.angle += DT * self.spin


class Touch:
    """A contact of two bodies; the impulse acts on the second."""

    def __init__(self, first: Body, second: Body, friction: float, recovery: float):
        offset = second.position - first.position
        distance = np.hypot(*offset)
        gap = distance - first.radius - second.radius
        self.first, self.second, self.friction = first, second, friction
        self.normal = offset / distance
        self.tangent = np.array([-self.normal[1], self.normal[0]])
        self.least = -gap / DT if gap > 0 else -recovery * gap / DT
        self.impulse = np.zeros(2)  # along the normal and the tangent

    def _slip(self, axis: np.ndarray) -> float:
        one = self.first.velocity_at(self.first.radius * self.normal)
        other = self.second.velocity_at(-self.second.radius * self.normal)
        return float((other - one) @ axis)

    def _mass(self, axis: np.ndarray) -> float:
        """Effective mass of both bodies at the contact (kg)."""
        total = 0.0
        for body, side in ((self.first, 1), (self.second, -1)):
            if np.isinf(body.mass):
                continue
            arm = side * body.radius * self.normal
            total += 1 / body.mass
            if body.on_table:
                cross = arm[0] * axis[1] - arm[1] * axis[0]
                total += cross**2 / (body.mass * body.radius**2 / 2)
        return 1 / total

    def solve(self):
        # Both speeds are of before: the engine answers them at once.
        normal_slip, tangent_slip = self._slip(self.normal), self._slip(self.tangent)
        normal = self.impulse[0] + self._mass(self.normal) * (self.least - normal_slip)
        normal = max(normal, 0.0)
        tangent = self.impulse[1] - self._mass(self.tangent) * tangent_slip
        tangent = np.clip(tangent, -self.friction * normal, self.friction * normal)
        new = np.array([normal, tangent])
        change = (new - self.impulse) @ np.stack([self.normal, self.tangent])
        self.impulse = new
        self.first.hit(-change, self.first.radius * self.normal)
        self.second.hit(change, -self.second.radius * self.normal)


class Press:
    """The friction of the table with a disk."""

    def __init__(self, disk: Body, friction: float, ratio: float):
        self.disk = disk
        self.limit = friction * disk.mass * GRAVITY * DT
        self.arm = ratio * disk.radius
        self.impulse = np.zeros(3)  # force x, force y, torque over its arm

    def solve(self):
        disk = self.disk
        inertia = disk.mass * disk.radius**2 / 2
        heavy = min(disk.mass, inertia / self.arm**2)
        speed = np.array([*disk.velocity, self.arm * disk.spin])
        new = self.impulse - heavy * speed
        size = np.linalg.norm(new)
        if size > self.limit:
            new *= self.limit / size
        change = new - self.impulse
        disk.velocity = disk.velocity + change[:2] / disk.mass
        disk.spin += change[2] * self.arm / inertia
        self.impulse = new


@dataclass
class World:
    """One scene: its disks, its pusher and what rubs how."""

    disks: list[Body]
    pusher: Body
    table_friction: float
    disk_friction: float
    pusher_friction: float
    ratio: float = 2 / 3
    sweeps: int = 10
    recovery: float = 0.08

    def step(self):
        presses = [Press(d, self.table_friction, self.ratio) for d in self.disks]
        touches = self._touches()
        for _ in range(self.sweeps):
            for constraint in [*presses, *touches]:
                constraint.solve()
        for body in [*self.disks, self.pusher]:
            body.move()

    def _touches(self) -> list[Touch]:
        pairs = [(self.pusher, disk, self.pusher_friction) for disk in self.disks]
        for i, first in enumerate(self.disks):
            pairs += [(first, d, self.disk_friction) for d in self.disks[i + 1 :]]
        return [Touch(*pair, self.recovery) for pair in pairs]

    def follow(self, place: np.ndarray):
        self.pusher.velocity = (place - self.pusher.position) / DT
        self.step()

    def push(self, force: np.ndarray, damping: float = 1000.0):
        pull = force - damping * self.pusher.velocity
        self.pusher.velocity = self.pusher.velocity + DT / self.pusher.mass * pull
        self.step()
