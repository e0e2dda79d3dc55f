"""What is trained on what, and where training begins."""

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import jax
import numpy as np

from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.schema import simulated_name, variables
from sainet.datasets.store import Store
from sainet.engines import make_assumed_engine
from sainet.errors import BadCheckpoint, BadInput, BadStore
from sainet.models.card import CARD, Card
from sainet.models.features import FeatureSizes
from sainet.models.interaction import InteractionNetwork, Scales
from sainet.models.widen import widen
from sainet.training.config import FitConfig, ModelKind
from sainet.training.loss import LossWeights
from sainet.training.single_steps import to_single_steps
from sainet.training.statistics import feature_scales, loss_weights
from sainet.training.step import FitState, first_state

_STATISTICS_PUSHES = 500  # enough for means and deviations, at any size of store
_SPLIT = 0x5B117
_ONLY_WATCHES = ("log_every", "checkpoint_every")  # settings that decide no weight
# Settings that came later: a folder from before, which lacks them, had these.
_LATER = {
    "recurrent": True,
    "features": "paper",
    "terms": "motion",
    "validation_share": 0.0,
    "patience": 0,
}


@dataclass(frozen=True)
class Start:
    """The network that training goes on from."""

    network: InteractionNetwork
    card: Card
    folder: Path


@dataclass(frozen=True)
class Task:
    """What is trained on what."""

    model: ModelKind
    store: Store
    config: FitConfig
    assumed_engine: str
    start: Start | None = None  # None: weights are drawn

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
    def sizes(self) -> FeatureSizes:
        """What the network sees."""
        place = self.config.features == "place"
        return FeatureSizes(self.store.info.kind, self.model == "sain", place)

    @cached_property
    def training(self) -> Store:
        """The pushes that are trained on."""
        kept, order = self._split
        return self.store.take(order[kept:]) if kept else self.store

    @cached_property
    def validation(self) -> Store | None:
        """The pushes that are kept for validation, if any."""
        kept, order = self._split
        return self.store.take(order[:kept]) if kept else None

    @property
    def _split(self) -> tuple[int, np.ndarray]:
        """Return how many pushes are kept, and the random order of all."""
        pushes, share = self.store.info.pushes, self.config.validation_share
        # At least one on either side.
        kept = min(max(round(share * pushes), 1), pushes - 1) if share else 0
        rng = np.random.default_rng([_SPLIT, self.config.seed])
        return kept, rng.permutation(pushes)

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
    if task.config.validation_share and info.pushes < 2:  # noqa: PLR2004
        raise BadInput(
            f"--validation-share is {task.config.validation_share}; {path} has only "
            f"{info.pushes} push."
        )
    if task.start:
        _check_start(task, task.start)
    if not task.config.recurrent:
        _check_single_steps(task)


def _check_start(task: Task, start: Start) -> None:
    """Raise `BadCheckpoint` if training cannot go on from that network."""
    info, card = task.store.info, start.card
    wanted = {
        "model": task.model,
        "kind": info.kind,
        "time_step": info.time_step,
        "inner_engine": task.simulated,
        "recurrent": task.config.recurrent,
    }
    for name, value in wanted.items():
        found = getattr(card, name)
        if found != value:
            raise BadCheckpoint(
                f"{start.folder / CARD}: {name} is {found!r}, this training's is "
                f"{value!r}; give --start-from another network."
            )
    if card.features == "place" and task.config.features == "paper":
        raise BadCheckpoint(
            f"{start.folder / CARD}: features is 'place'; give --features place, too."
        )


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
    start = {"start_from": task.start.card.weights} if task.start else {}
    return {
        "command": "train",
        "model": task.model,
        "assumed_engine": task.assumed_engine,
        "data": task.store.content,
        **start,
        **config,
    }


def begin(task: Task) -> tuple[FitState, LossWeights]:
    """Return the first state and the weights of the loss, from the data."""
    store, config = task.training, task.config
    few = slice(0, min(_STATISTICS_PUSHES, store.info.pushes))
    sample = task.to_sample(store.read(few, task.names))
    network = _first_network(task, feature_scales(sample, task.sizes))
    return first_state(network, config), loss_weights(sample, config)


def _first_network(task: Task, scales: Scales) -> InteractionNetwork:
    if task.start is None:
        return InteractionNetwork(
            task.sizes,
            time_step=task.store.info.time_step,
            key=jax.random.key(task.config.seed),
            scales=scales,
        )
    network = task.start.network
    return widen(network, scales) if task.sizes != network.sizes else network
