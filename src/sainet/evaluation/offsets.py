"""Where a model goes wrong: signed errors at the ends of pushes, not their sizes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sainet.datasets.store import Store
from sainet.evaluation.evaluate import predict_ends
from sainet.models.library import Model


@dataclass(frozen=True)
class EndOffsets:
    """What is left of the motion of the pushed disk once a model has told its part."""

    place: Float[np.ndarray, "push 2"]  # m, of the disk before the push
    heading: Float[np.ndarray, " push"]  # rad, of the push on the table
    offset: Float[np.ndarray, "push 2"]  # m, observed minus predicted, on the table
    turn: Float[np.ndarray, " push"]  # rad, likewise

    @property
    def along(self) -> Float[np.ndarray, " push"]:
        """The offset along the push, m."""
        return np.sum(self.offset * self._ahead, axis=-1)

    @property
    def across(self) -> Float[np.ndarray, " push"]:
        """The offset to the left of the push, m."""
        x, y = self._ahead.T
        return self.offset[:, 1] * x - self.offset[:, 0] * y

    @property
    def _ahead(self) -> Float[np.ndarray, "push 2"]:
        return np.column_stack([np.cos(self.heading), np.sin(self.heading)])


def end_offsets(model: Model, store: Store) -> EndOffsets:
    """Predict every push along a path and return what the model misses of its end."""
    names = ("initial", "initial_pusher", "command_position", "steps")
    arrays = store.read(slice(None), names)
    predicted, observed = predict_ends(model, store)
    missed = (observed - predicted)[:, 0]
    push = np.arange(store.info.pushes)
    way = arrays["command_position"][push, arrays["steps"] - 1]
    way = (way - arrays["initial_pusher"]).astype(np.float64)
    return EndOffsets(
        place=arrays["initial"][:, 0, :2].astype(np.float64),
        heading=np.arctan2(way[:, 1], way[:, 0]),
        offset=missed[:, :2],
        turn=np.mod(missed[:, 2] + np.pi, 2 * np.pi) - np.pi,
    )
