"""What is trained on what, and where training begins."""

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import jax
import msgspec
import numpy as np

from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.predictions import add_prediction, as_measured, is_stored
from sainet.datasets.schema import simulated_name, variables
from sainet.datasets.splits import split_rows
from sainet.datasets.store import Store
from sainet.engines.simulator import InternalEngine, PlanarSpec, SimulatorSpec
from sainet.learning.config import FROM_ENGINE, FitConfig, ModelKind
from sainet.learning.loss import LossWeights
from sainet.learning.mirror import mirror_some
from sainet.learning.single_steps import to_single_steps
from sainet.learning.statistics import feature_scales, loss_weights
from sainet.learning.step import FitState, first_state
from sainet.models.card import CARD, Card
from sainet.models.correctors.interaction import InteractionNetwork, Scales
from sainet.models.features import FeatureSet, feature_set
from sainet.models.integrators import Acceleration, Integrator, RelaxingResidual
from sainet.models.widen import widen
from sainet.runs.errors import BadCheckpoint, BadInput, BadStore

_STATISTICS_PUSHES = 500  # enough for means and deviations, at any size of store
_ONLY_WATCHES = ("log_every", "checkpoint_every")  # settings that decide no weight


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
    assumed: InternalEngine
    start: Start | None = None  # None: weights are drawn
    from_engine: bool = False  # drawn so that the network is the engine at first

    @property
    def inner(self) -> InternalEngine | None:
        """The internal engine of the network, if it has one."""
        return self.assumed if self.model == "sain" else None

    @property
    def names(self) -> tuple[str, ...]:
        """The arrays of the store that training reads."""
        unread = ("truth_pusher", "group", "repeat", "published")
        skip = lambda name: name.startswith(("simulated_", *unread))  # noqa: E731
        kept = [name for name in variables(self.store.info) if not skip(name)]
        if not is_stored(self.assumed, self.store.info):
            return tuple(kept)
        return (*kept, simulated_name(self.assumed.simulator.slug))

    @property
    def features(self) -> FeatureSet:
        """The inputs of the network."""
        return feature_set(
            self.store.info.kind,
            simulator=self.model == "sain",
            place=self.config.features == "place",
        )

    @property
    def integrator(self) -> Integrator:
        """The integrator of a new network."""
        return RelaxingResidual() if self.from_engine else Acceleration()

    @cached_property
    def training(self) -> Store:
        """The pushes that are trained on."""
        return self.store.take(self._split[0]) if self.validation else self.store

    @cached_property
    def validation(self) -> Store | None:
        """The pushes that are kept for validation, if any."""
        kept = self._split[1]
        return self.store.take(kept) if len(kept) else None

    @cached_property
    def _split(self) -> tuple[np.ndarray, np.ndarray]:
        config = self.config
        return split_rows(self.store.repeats(), config.validation_share, config.seed)

    def complete(self, arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return stored arrays with the prediction that the network sees."""
        if self.inner is None:
            return arrays
        return add_prediction(self.inner, arrays, self.store.info)[0]

    def to_batch(self, arrays: dict[str, np.ndarray], steps: int) -> PushBatch:
        """Turn stored arrays into a batch with what the network sees."""
        return self._batch(arrays, steps, self.inner)

    def to_training_batch(
        self, arrays: dict[str, np.ndarray], steps: int, iteration: int
    ) -> PushBatch:
        """Turn stored arrays into what an iteration is trained on."""
        batch, config = self.to_batch(arrays, steps), self.config
        if not config.mirror or config.features == "place":
            return batch
        return mirror_some(batch, config.seed, iteration)

    def to_sample(self, arrays: dict[str, np.ndarray]) -> PushBatch:
        """Return what statistics are of: s-bar stands in for an unknown truth."""
        return self._batch(arrays, self.store.info.steps, self.assumed)

    def _batch(
        self, arrays: dict[str, np.ndarray], steps: int, inner: InternalEngine | None
    ) -> PushBatch:
        info, steps = self.store.info, min(steps, self.config.steps)
        simulated = None
        if inner is not None:
            arrays, simulated = add_prediction(inner, arrays, info)
        batch = to_batch(arrays, info, steps=steps, simulated=simulated)
        batch = batch if inner is None else as_measured(inner, batch)
        if self.config.recurrent:
            return batch
        # IN's statistics are of an engine's path too, but not of its single steps.
        return to_single_steps(
            batch, self.inner.simulator.build() if self.inner else None
        )


def check_data(task: Task) -> None:
    """Raise `BadStore` or `BadInput` if the data lack what training needs."""
    path = task.store.path
    _check_assumed(task)
    if task.from_engine and task.inner is None:
        raise BadInput(
            f"`start_from` {FROM_ENGINE} needs a network that corrects an engine; "
            f"train sain, not {task.model}."
        )
    if task.config.validation_share and task.validation is None:
        raise BadInput(
            f"`validation_share` is {task.config.validation_share}; {path} has no two "
            "pushes that are not repeats of each other."
        )
    if task.start:
        _check_start(task, task.start)
    if not task.config.recurrent:
        _check_single_steps(task)


def _check_assumed(task: Task) -> None:
    info, path, simulator = task.store.info, task.store.path, task.assumed.simulator
    if not simulator.is_identified and simulator.slug not in info.assumed_engines:
        raise BadStore(
            f"{path}: assumed_engines has no {simulator.slug!r}; give `assumed_engine` "
            f"{' or '.join(info.assumed_engines)}, which it has, or the folder of "
            "identified parameters."
        )
    if simulator.is_identified and info.kind != "robot":
        raise BadStore(
            f"{path}: kind is {info.kind!r}; an identified engine predicts pushes of "
            "the robot setup."
        )


def _check_start(task: Task, start: Start) -> None:
    """Raise `BadCheckpoint` if training cannot go on from that network."""
    info, card = task.store.info, start.card
    wanted = {
        "kind": info.kind,
        "time_step": info.time_step,
        "recurrent": task.config.recurrent,
    }
    pairs = {name: (getattr(card, name), value) for name, value in wanted.items()}
    pairs["identity.kind"] = (card.identity.kind, task.model)
    for name, (found, value) in pairs.items():
        if found != value:
            raise BadCheckpoint(
                f"{start.folder / CARD}: {name} is {found!r}, this training's is "
                f"{value!r}; give `start_from` another network."
            )
    _check_inner_engine(task, start)
    if card.identity.features == "place" and task.config.features == "paper":
        raise BadCheckpoint(
            f"{start.folder / CARD}: features is 'place'; give `features` place, too."
        )


def _check_inner_engine(task: Task, start: Start) -> None:
    """Raise `BadCheckpoint` if the network was trained around too different an engine.

    An identified engine is the planar one with other parameters: a network that was
    trained around the planar engine is trained further from there.
    """
    found = start.card.identity.simulator
    wanted = task.inner.simulator if task.inner else None
    if found == wanted or (_is_planar_like(found) and _is_identified(wanted)):
        return
    names = [spec.slug if spec else None for spec in (found, wanted)]
    raise BadCheckpoint(
        f"{start.folder / CARD}: the internal engine is {names[0]!r}, this training's "
        f"is {names[1]!r}; give `start_from` another."
    )


def _is_identified(spec: SimulatorSpec | None) -> bool:
    return spec is not None and spec.is_identified


def _is_planar_like(spec: SimulatorSpec | None) -> bool:
    return spec == PlanarSpec() or _is_identified(spec)


def _check_single_steps(task: Task) -> None:
    info, path = task.store.info, task.store.path
    if info.kind != "robot" or info.is_recorded:
        raise BadStore(
            f"{path}: single steps need simulated pushes of the robot setup, whose "
            "state is known at every step; leave `recurrent` on."
        )
    if task.inner and task.inner.simulator.build().on_host:
        raise BadInput(
            f"`assumed_engine` {task.inner.simulator.slug} cannot restart at every "
            "step of a training; use planar, or train on whole pushes."
        )


def settings(task: Task) -> dict[str, Any]:
    """Return what decides the weights, as JSON values."""
    config = asdict(task.config)
    for name in _ONLY_WATCHES:
        del config[name]
    start = {"start_from": task.start.card.weights} if task.start else {}
    start = {"start_from": FROM_ENGINE} if task.from_engine else start
    return {
        "command": "train",
        "model": task.model,
        "internal_engine": msgspec.to_builtins(task.assumed),
        "data": task.store.content,
        **start,
        **config,
    }


def begin(task: Task) -> tuple[FitState, LossWeights]:
    """Return the first state and the weights of the loss, from the data."""
    store, config = task.training, task.config
    few = slice(0, min(_STATISTICS_PUSHES, store.info.pushes))
    sample = task.to_sample(store.read(few, task.names))
    scales = feature_scales(sample, task.features, task.integrator)
    network = _first_network(task, scales)
    return first_state(network, config), loss_weights(sample, config)


def _first_network(task: Task, scales: Scales) -> InteractionNetwork:
    if task.start is None:
        return InteractionNetwork(
            task.features,
            time_step=task.store.info.time_step,
            key=jax.random.key(task.config.seed),
            scales=scales,
            integrator=task.integrator,
        )
    network = task.start.network
    return widen(network, scales) if task.features != network.features else network
