"""Plans, and the interface of planners."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.models.dynamics import AbstractDynamics, check_purpose
from sainet.models.library import Loadable, as_model
from sainet.planning.checks import check_observation, doubts
from sainet.planning.levels import Found, Problem, batch_of, predicted_ends, roll_pushes
from sainet.runs.errors import require
from sainet.scenes.controls import PathControls
from sainet.scenes.pushes import Push, PushGrid, settled_steps
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, at_rest
from sainet.tasks.push_to_goal import AbstractTask


@dataclass(frozen=True)
class Plan:
    """The pushes selected by a planner, in order of execution.

    Attributes:
        pushes: single pushes.
        predict: returns `path`.
        cost: at the end of the path.
        distance: of the target disk from the goal at the end of the path (m).
        evaluated: number of predicted candidate pushes.
        is_complete: False: a deadline or limit ended the search early.
        warnings: why the prediction may be inaccurate.
    """

    pushes: tuple[Push, ...]
    predict: Callable[[], Float[np.ndarray, "time body 3"]] = field(repr=False)
    cost: float
    distance: float
    evaluated: int
    is_complete: bool = True
    warnings: tuple[str, ...] = ()

    @cached_property
    def path(self) -> Float[np.ndarray, "time body 3"]:
        """The predicted poses over all pushes (m, m, rad), computed when first read."""
        return self.predict()


class AbstractPlanner(eqx.Module):
    """A planner, which selects the next pushes; stateless between decisions."""

    actions: eqx.AbstractVar[PushGrid]
    expected: eqx.AbstractVar[bool]  # judge by expected costs

    @abstractmethod
    def search(self, problem: Problem) -> Found:
        """Return the best sequence of actions, as indices into the grid."""

    def plan(
        self, model: Loadable, task: AbstractTask, scene: Scene, state: State
    ) -> Plan:
        """Return the plan for the next pushes, with its predicted path.

        Args:
            model: predicts; a model, its dynamics, its name or its folder. Names and
                folders are read in every call.
            task: task to solve.
            scene: one scene, without a batch axis, with the properties for the model.
            state: observed state, assumed to be at rest.

        Raises:
            BadScene: the observation is not finite or not of this scene, disks overlap,
                the scene has no target disk, or the goal is none of the table.
            BadCheckpoint: the model is for another time step or other controls.
            Diverged: no candidate push has a finite prediction.
        """
        dynamics, kind = as_model(model).dynamics, PathControls.kind
        is_task = hasattr(task, "seen_from")
        require(is_task, "task", "a task, for example PushToGoal([0.2, 0.05])", task)
        disks = scene.body_count
        check_purpose(dynamics, kind, scene.time_step, disks)
        gap = check_observation(scene, state)
        roll = partial(predicted_ends, dynamics.engine_alone or dynamics, scene)
        task = task.seen_from(roll, scene, state, self.actions)
        problem = Problem(dynamics, task, scene, state, self.actions, self.expected)
        found = self.search(problem)
        pushes = tuple(
            jax.tree.map(lambda x, i=i: x[i], problem.pushes) for i in found.actions
        )
        return Plan(
            pushes=pushes,
            predict=partial(predicted_path, dynamics, scene, state, pushes),
            cost=found.cost,
            distance=found.distance,
            evaluated=found.evaluated,
            is_complete=found.is_complete,
            warnings=tuple(doubts(dynamics, gap, pushes)),
        )


def predicted_path(
    dynamics: AbstractDynamics, scene: Scene, state: State, pushes: tuple[Push, ...]
) -> Float[np.ndarray, "time body 3"]:
    """Return the poses over all pushes, each of which starts at rest (m, m, rad)."""
    roll = _path_and_rest if dynamics.on_host else _compiled_path_and_rest
    state = jax.tree.map(_batch_of_one, state)
    poses = []
    for push in pushes:
        steps = settled_steps(push, scene.time_step)
        one = jax.tree.map(_batch_of_one, push)
        pose, state = roll(dynamics, scene, state, one, steps)
        poses.append(np.asarray(pose)[0])
    return np.concatenate(poses)


def _batch_of_one(x: Array | np.ndarray | np.generic) -> Array:
    return jnp.asarray(np.asarray(x)[None])


def _path_and_rest(
    dynamics: AbstractDynamics, scene: Scene, state: State, push: Push, steps: int
) -> tuple[Float[Array, "1 time body 3"], State]:
    trajectory = roll_pushes(dynamics, batch_of(scene, 1), state, push, steps)
    end = trajectory.final
    return trajectory.states.pose, at_rest(end.position, end.angle, end.pusher_position)


_compiled_path_and_rest = eqx.filter_jit(_path_and_rest)
