"""A plan, and what every planner can do."""

from abc import abstractmethod
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.models.dynamics import AbstractDynamics
from sainet.planning.checks import check_model, check_observation, doubts
from sainet.planning.outcomes import batch_of, roll_pushes
from sainet.scenes.pushes import Push, PushGrid
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, at_rest
from sainet.tasks.base import AbstractTask


@dataclass(frozen=True)
class Plan:
    """The pushes that a planner chose, the next one first."""

    pushes: tuple[Push, ...]
    path: Float[np.ndarray, "time body 3"]  # predicted poses, push after push
    cost: float  # at the end
    distance: float  # at the end, m
    looked_at: int  # pushes that were predicted to choose these
    is_complete: bool = True  # False: a deadline or a search's own limit came first
    warnings: tuple[str, ...] = ()  # why the prediction may be worth less


class AbstractPlanner(eqx.Module):
    """Chooses the next pushes; remembers nothing from one decision to the next."""

    actions: eqx.AbstractVar[PushGrid]

    @abstractmethod
    def search(
        self, dynamics: AbstractDynamics, task: AbstractTask, scene: Scene, state: State
    ) -> "Found":
        """Return the best sequence of actions, as indices into the grid."""

    def plan(
        self, dynamics: AbstractDynamics, task: AbstractTask, scene: Scene, state: State
    ) -> Plan:
        """Return what to do next, and what will come of it.

        Args:
            dynamics: predicts; any model.
            task: what is to be done.
            scene: one scene, without a batch axis, as the model is to believe it.
            state: as it was observed; it is taken to be at rest.

        Raises:
            BadScene: the observation is not finite, disks lie in one another, or the
                task is about one that is not there.
            BadCheckpoint: the model is for another time step or for other controls.
            Diverged: whatever is pushed, the model leaves the finite numbers.
        """
        check_model(dynamics, scene)
        gap = check_observation(scene, state)
        found = self.search(dynamics, task, scene, state)
        grid = jax.device_get(self.actions.pushes())
        pushes = tuple(jax.tree.map(lambda x, i=i: x[i], grid) for i in found.actions)
        path = predicted_path(dynamics, scene, state, pushes)
        return Plan(
            pushes=pushes,
            path=path,
            cost=found.cost,
            distance=found.distance,
            looked_at=found.looked_at,
            is_complete=found.is_complete,
            warnings=tuple(doubts(dynamics, gap, pushes)),
        )


@dataclass(frozen=True)
class Found:
    """What a search ends with."""

    actions: tuple[int, ...]
    cost: float
    distance: float  # m
    looked_at: int
    is_complete: bool = True


def predicted_path(
    dynamics: AbstractDynamics, scene: Scene, state: State, pushes: tuple[Push, ...]
) -> Float[np.ndarray, "time body 3"]:
    """Return the poses over all pushes, every push from rest."""
    roll = _path_and_rest if dynamics.on_host else _compiled_path_and_rest
    state = jax.tree.map(_batch_of_one, state)
    poses = []
    for push in pushes:
        pose, state = roll(dynamics, scene, state, jax.tree.map(_batch_of_one, push))
        poses.append(np.asarray(pose)[0])
    return np.concatenate(poses)


def _batch_of_one(x: Array | np.ndarray | np.generic) -> Array:
    return jnp.asarray(np.asarray(x)[None])


def _path_and_rest(
    dynamics: AbstractDynamics, scene: Scene, state: State, push: Push
) -> tuple[Float[Array, "1 time body 3"], State]:
    trajectory = roll_pushes(dynamics, batch_of(scene, 1), state, push)
    states, end = trajectory.states, trajectory.final
    pose = jnp.concatenate([states.position, states.angle[..., None]], axis=-1)
    return pose, at_rest(end.position, end.angle, end.pusher_position)


_compiled_path_and_rest = eqx.filter_jit(_path_and_rest)
