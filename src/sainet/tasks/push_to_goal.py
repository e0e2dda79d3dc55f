"""The paper's task (section IV-A): push disk 1 until the target disk is at its goal.

Goals are random: easy goals ahead, hard goals aside.
"""

from abc import abstractmethod
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from sainet.runs.errors import BadScene
from sainet.scenes import quantities
from sainet.scenes.geometry import norm
from sainet.scenes.pushes import PushGrid
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, floats
from sainet.tasks import Goals
from sainet.tasks.steering import Roll, Steering, steering_of


class AbstractTask(eqx.Module):
    """A task that the robot has to solve; arguments share their leading batch axes."""

    @abstractmethod
    def distance(self, state: State) -> Float[Array, "*batch"]:
        """Return the remaining distance (m)."""

    @abstractmethod
    def cost(self, state: State) -> Float[Array, "*batch"]:
        """Return the cost that planners minimise (m)."""

    @abstractmethod
    def is_solved(self, scene: Scene, state: State) -> Bool[Array, "*batch"]:
        """Return whether the task is solved."""

    def seen_from(
        self, roll: Roll, scene: Scene, state: State, grid: PushGrid
    ) -> "AbstractTask":
        """Return the task with a cost for this decision, by default as it is.

        Args:
            roll: predicts where pushes end.
            scene: one scene, without a batch axis.
            state: observed, at rest.
            grid: candidate pushes.
        """
        del roll, scene, state, grid
        return self


TOLERANCE_RADII = 0.1
ALIGNMENT = 3.0
_ROW = 2  # least index of the target disk of a row


class PushToGoal(AbstractTask):
    """Move the target disk to a goal by pushing disk 1.

    The cost is the paper's heuristic, ``|p_m - g| + w (1 - cos)``, with the cosine of
    the angle at disk 1 between the goal and the target disk: this term keeps both disks
    and the goal on one line. (The paper adds a length and a number, w = 1.)

    In a row of more disks, the cost is ``|p_m - g|`` and the effort of steering that
    the planner measured for this decision.

    Attributes:
        goal: of the target disk, [2] (m); a list or an array.
        moved: index of the target disk, from 0.
        tolerance: fraction of the radius of the target disk.
        alignment: w (m).
        steering: of the row from disk 1 to the target disk; None with two disks.
    """

    goal: Float[Array, " 2"] = eqx.field(converter=lambda p: floats(p, "task: goal"))
    moved: int = eqx.field(static=True, default=1)
    tolerance: float = eqx.field(static=True, default=TOLERANCE_RADII)
    alignment: float = eqx.field(static=True, default=ALIGNMENT)
    steering: Steering | None = None

    def __check_init__(self) -> None:
        """Refuse impossible settings."""
        quantities.FRACTION.require("tolerance", self.tolerance)
        quantities.ALIGNMENT.require("alignment", self.alignment)

    def distance(self, state: State) -> Float[Array, "*batch"]:
        """Return the distance of the target disk from the goal (m).

        Args:
            state: of the disks; one distance for each state of a batch.

        Raises:
            BadScene: the scene has no disk with this index.
        """
        return norm(self._to_goal(self._moved(state)))

    def cost(self, state: State) -> Float[Array, "*batch"]:
        """Return the paper's heuristic h(p_1, p_m, g), or that of a row (m).

        Args:
            state: of the disks; one cost for each state of a batch.
        """
        distance, place = self.distance(state), state.position
        if self.steering is not None:
            row = place[..., : self.moved + 1, :]
            return distance + self.steering.cost(row, self._to_goal(row[..., -1, :]))
        first = place[..., 0, :]
        ahead, wanted = self._moved(state) - first, self._to_goal(first)
        lengths = jnp.maximum(norm(ahead) * norm(wanted), 1e-12)
        cosine = jnp.sum(ahead * wanted, axis=-1) / lengths
        return distance + self.alignment * (1 - cosine)

    def seen_from(
        self, roll: Roll, scene: Scene, state: State, grid: PushGrid
    ) -> "PushToGoal":
        """Return the task with the steering of its row, if there is one.

        Raises:
            BadScene: the scene has no such disk, or the goal is not one in range.
        """
        self._moved(state)
        quantities.POSITION.check(self.goal, "task: goal", error=BadScene)
        if np.shape(self.goal) != (2,):
            shape = list(np.shape(self.goal))
            raise BadScene(f"task: goal has the shape {shape}; give x and y (m).")
        if self.moved < _ROW:
            return self
        miss = max(self.tolerance, 1e-3) * float(scene.radius[self.moved])
        found = steering_of(roll, scene, state, grid, row=self.moved + 1, miss=miss)
        return replace(self, steering=found)

    def is_solved(self, scene: Scene, state: State) -> Bool[Array, "*batch"]:
        """Return whether the target disk is within the tolerance of the goal.

        Args:
            scene: with the radius of the target disk (m).
            state: of the disks; one answer for each state of a batch.
        """
        return self.distance(state) <= self.tolerance * scene.radius[..., self.moved]

    def _moved(self, state: State) -> Float[Array, "*batch 2"]:
        # JAX would clamp an index out of range to the last disk.
        if not 0 <= self.moved < state.body_count:
            raise BadScene(
                f"task: moved is {self.moved}, but the scene has {state.body_count} "
                f"disks; give an index from 0 to {state.body_count - 1}."
            )
        return state.position[..., self.moved, :]

    def _to_goal(self, place: Float[Array, "*batch 2"]) -> Float[Array, "*batch 2"]:
        return jnp.broadcast_to(self.goal, place.shape) - place


# Angles from the axis through the disks, to either side (degrees).
ANGLES: dict[Goals, tuple[float, float]] = {"easy": (0.0, 30.0), "hard": (30.0, 60.0)}
DISTANCE_RADII = 3.0
_STREAM = 0x60A1


def draw_goal(
    kind: Goals, seed: int, trial: int, *, disk: np.ndarray, axis: float, radius: float
) -> np.ndarray:
    """Return the position of a goal (m); equal seeds and trials have equal goals.

    Args:
        kind: easy or hard.
        seed: common to all trials.
        trial: index of the trial.
        disk: centre of the target disk, m.
        axis: angle of the axis through the disks, rad.
        radius: radius of the target disk, m.
    """
    rng = np.random.default_rng([_STREAM, seed, trial, list(ANGLES).index(kind)])
    low, high = np.deg2rad(ANGLES[kind])
    angle = axis + rng.uniform(low, high) * rng.choice([-1, 1])
    way = np.array([np.cos(angle), np.sin(angle)])
    return np.asarray(disk) + DISTANCE_RADII * radius * way
