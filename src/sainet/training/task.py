"""What is trained on what, and where training begins."""

from dataclasses import asdict, dataclass
from typing import Any

import jax
import numpy as np

from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.schema import simulated_name, variables
from sainet.datasets.store import Store
from sainet.engines import make_assumed_engine
from sainet.errors import BadInput, BadStore
from sainet.models.features import FeatureSizes
from sainet.models.interaction import InteractionNetwork
from sainet.training.config import FitConfig, ModelKind
from sainet.training.loss import LossWeights
from sainet.training.single_steps import to_single_steps
from sainet.training.statistics import feature_scales, loss_weights
from sainet.training.step import FitState, first_state

_STATISTICS_PUSHES = 500  # enough for means and deviations, at any size of store
_ONLY_WATCHES = ("log_every", "checkpoint_every")  # settings that decide no weight
# Settings that came later: a folder from before, which lacks them, had these.
_LATER = {"recurrent": True}


@dataclass(frozen=True)
class Task:
    """What is trained on what."""

    model: ModelKind
    store: Store
    config: FitConfig
    assumed_engine: str

    @property
    def simulated(self) -> str | None:
        """The assumed engine whose prediction the network sees."""
        return self.assumed_engine if self.model == "sain" else None

    @property
    def names(self) -> tuple[str, ...]:
        """The arrays of the store that training reads."""
        unread = ("truth_pusher", "group", "published")
        skip = lambda name: name.startswith(("simulated_", *unread))  # noqa: E731
        kept = [name for name in variables(self.store.info) if not skip(name)]
        return (*kept, simulated_name(self.assumed_engine))

    @property
    def training_pushes(self) -> int:
        """How many of the store's first pushes are trained on."""
        return self.store.info.pushes - self.config.validation_pushes

    def to_batch(self, arrays: dict[str, np.ndarray], steps: int) -> PushBatch:
        """Turn stored arrays into a batch with what the network sees."""
        return self._batch(arrays, steps, self.simulated)

    def to_sample(self, arrays: dict[str, np.ndarray]) -> PushBatch:
        """Return what statistics are of: s-bar stands in for an unknown truth."""
        return self._batch(arrays, self.store.info.steps, self.assumed_engine)

    def _batch(
        self, arrays: dict[str, np.ndarray], steps: int, simulated: str | None
    ) -> PushBatch:
        steps = min(steps, self.config.steps)
        batch = to_batch(arrays, self.store.info, steps=steps, simulated=simulated)
        if self.config.recurrent:
            return batch
        return to_single_steps(
            batch, make_assumed_engine(simulated) if simulated else None
        )


def check_data(task: Task) -> None:
    """Raise `BadStore` or `BadInput` if the data lack what training needs."""
    info, path = task.store.info, task.store.path
    if task.assumed_engine not in info.assumed_engines:
        raise BadStore(
            f"{path}: assumed_engines has no {task.assumed_engine!r}; generate the "
            f"data with --assumed-engine {task.assumed_engine}."
        )
    if task.training_pushes < 1:
        raise BadInput(
            f"--validation-pushes is {task.config.validation_pushes}; {path} has only "
            f"{info.pushes} pushes."
        )
    if not task.config.recurrent:
        _check_single_steps(task)


def _check_single_steps(task: Task) -> None:
    info, path = task.store.info, task.store.path
    if info.kind != "robot" or info.engine == "recorded":
        raise BadStore(
            f"{path}: --no-recurrent needs simulated pushes of the robot setup, whose "
            "state is known at every step; leave it out."
        )
    if task.simulated and make_assumed_engine(task.simulated).on_host:
        raise BadInput(
            f"--assumed-engine {task.simulated} cannot restart at every step of a "
            "training; take planar, or leave --no-recurrent out."
        )


def settings(task: Task) -> dict[str, Any]:
    """Return what decides the weights, as JSON values."""
    config = asdict(task.config)
    for name in _ONLY_WATCHES:
        del config[name]
    for name, before in _LATER.items():
        if config[name] == before:
            del config[name]
    return {
        "command": "train",
        "model": task.model,
        "assumed_engine": task.assumed_engine,
        "data": task.store.content,
        **config,
    }


def begin(task: Task) -> tuple[FitState, LossWeights]:
    """Return the untrained state and the weights of the loss, from the data."""
    info = task.store.info
    few = slice(0, min(_STATISTICS_PUSHES, task.training_pushes))
    sample = task.to_sample(task.store.read(few, task.names))
    sizes = FeatureSizes(info.kind, task.model == "sain")
    network = InteractionNetwork(
        sizes,
        time_step=info.time_step,
        key=jax.random.key(task.config.seed),
        scales=feature_scales(sample, sizes),
    )
    return first_state(network, task.config), loss_weights(sample, task.config)
