"""A plan, and what every planner can do."""

from abc import abstractmethod
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from sainet.errors import BadScene
from sainet.models.dynamics import AbstractDynamics
from sainet.planning.outcomes import batch_of, roll_pushes
from sainet.pushes import Push, PushGrid
from sainet.scene import Scene, State, at_rest, check_state, pair_gaps
from sainet.tasks.base import AbstractTask

_DEEPEST_OVERLAP = 5e-3  # m, of disks that were seen; more is no noise of a camera
_APART = 5e-3  # m: networks were trained on disks that touch


@dataclass(frozen=True)
class Plan:
    """The pushes that a planner chose, the next one first."""

    pushes: tuple[Push, ...]
    path: Float[np.ndarray, "time body 3"]  # predicted poses, push after push
    cost: float  # at the end
    distance: float  # at the end, m
    looked_at: int  # pushes that were predicted to choose these
    is_complete: bool = True  # False: a deadline came first
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
            BadScene: the observation is not finite, or disks lie in one another.
        """
        check_observation(scene, state)
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
            warnings=tuple(_warnings(scene, state)),
        )


@dataclass(frozen=True)
class Found:
    """What a search ends with."""

    actions: tuple[int, ...]
    cost: float
    distance: float  # m
    looked_at: int
    is_complete: bool = True


def check_observation(scene: Scene, state: State) -> None:
    """Raise `BadScene` if nothing can be planned from what was observed."""
    check_state(state, "observation")
    gap = float(np.min(np.asarray(pair_gaps(scene, state)), initial=np.inf))
    if gap < -_DEEPEST_OVERLAP:
        raise BadScene(
            f"observation: two disks overlap by {-1000 * gap:.1f} mm; check the poses "
            "and the radii."
        )


def predicted_path(
    dynamics: AbstractDynamics, scene: Scene, state: State, pushes: tuple[Push, ...]
) -> Float[np.ndarray, "time body 3"]:
    """Return the poses over all pushes, every push from rest."""
    roll = roll_pushes if dynamics.on_host else _compiled_roll
    state = jax.tree.map(lambda x: jnp.asarray(x)[None], state)
    poses = []
    for push in pushes:
        one = jax.tree.map(lambda x: jnp.asarray(x)[None], push)
        trajectory = roll(dynamics, batch_of(scene, 1), state, one)
        states, end = trajectory.states, trajectory.final
        pose = [states.position, states.angle[..., None]]
        poses.append(np.concatenate([np.asarray(x)[0] for x in pose], axis=-1))
        state = at_rest(end.position, end.angle, end.pusher_position)
    return np.concatenate(poses)


_compiled_roll = eqx.filter_jit(roll_pushes)


def _warnings(scene: Scene, state: State) -> list[str]:
    gaps = np.asarray(pair_gaps(scene, state))
    if scene.body_count > 1 and float(np.min(gaps)) > _APART:
        return [
            f"no two disks are within {1000 * _APART:g} mm of each other: networks "
            "were trained on disks that touch"
        ]
    return []
