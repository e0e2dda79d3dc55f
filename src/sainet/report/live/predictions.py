"""What several models predict for one push, and how far their predictions differ."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.models.library import Model
from sainet.planning.base import predicted_path
from sainet.report.live.messages import BadMessage
from sainet.scenes.geometry import wrap_angle
from sainet.scenes.pushes import Push, PushGrid, place_pusher
from sainet.scenes.scene import Scene, pusher_gaps
from sainet.scenes.state import State, at_rest

_GRID = PushGrid()
STROKE = _GRID.length  # m
_DEEPEST = 1e-4  # m, that the pusher may start inside another disk

Path = Float[np.ndarray, "time body 3"]  # m, m, rad


def push_at(contact_angle_deg: float, direction_deg: float) -> Push:
    """Return a push of the paper's stroke and speed."""
    angles = np.deg2rad([contact_angle_deg, direction_deg])
    numbers = (*angles, _GRID.length, _GRID.speed)
    return Push(*(jnp.float32(number) for number in numbers))


@dataclass(frozen=True)
class Moment:
    """What predictions start from: the scene given to models and the measured poses."""

    scene: Scene
    observed: State

    def check_start(self, push: Push) -> None:
        """Raise `BadMessage` if the pusher would start inside another disk."""
        gaps = np.asarray(_start_gaps(self.scene, self.observed, push))[1:]
        if gaps.min(initial=np.inf) < -_DEEPEST:
            raise BadMessage(
                f"The pusher would start inside disk {2 + int(gaps.argmin())}; aim at "
                "another side of disk 1."
            )


@eqx.filter_jit
def _start_gaps(scene: Scene, state: State, push: Push) -> Float[Array, " body"]:
    start = place_pusher(scene, state, push)
    return pusher_gaps(scene, at_rest(state.position, state.angle, start))


@dataclass(frozen=True)
class Predictor:
    """Models by name; each is compiled once for a number of disks."""

    models: Mapping[str, Model]

    def paths(self, moment: Moment, push: Push) -> dict[str, Path]:
        """Return the predicted poses of the disks over a push, by model."""
        return {
            name: predicted_path(model.dynamics, moment.scene, moment.observed, (push,))
            for name, model in self.models.items()
        }

    def compile(self, moment: Moment) -> None:
        """Compile every model for this number of disks, on all cores."""
        push = push_at(0.0, 0.0)

        def predict(model: Model) -> None:
            predicted_path(model.dynamics, moment.scene, moment.observed, (push,))

        with ThreadPoolExecutor() as pool:
            list(pool.map(predict, self.models.values()))
        _start_gaps(moment.scene, moment.observed, push)


@dataclass(frozen=True)
class Difference:
    """How far poses are from others: mm and degrees of each disk."""

    mm: list[float]
    deg: list[float]

    @classmethod
    def between(
        cls, pose: Float[np.ndarray, "body 3"], other: Float[np.ndarray, "body 3"]
    ) -> "Difference":
        """Return the distance of each disk, and the angle between both poses."""
        offset = np.asarray(pose, np.float64) - other
        deg = np.abs(np.rad2deg(wrap_angle(offset[:, 2])))
        mm = 1000 * np.linalg.norm(offset[:, :2], axis=1)
        return cls(mm.round(3).tolist(), deg.round(3).tolist())
