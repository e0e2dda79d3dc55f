"""Training jobs: model, data, recipe, and the state before the first iteration."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import msgspec
import numpy as np

from sainet.datasets.batch import Prediction, PushBatch, to_batch
from sainet.datasets.splits import split_rows
from sainet.datasets.store import Store
from sainet.engines.simulator import InternalEngine
from sainet.learning.batches import mirror_some, to_single_steps
from sainet.learning.loss import LossWeights, feature_scales, loss_weights
from sainet.learning.recipes import FROM_ENGINE, FromSimulator, Recipe, SingleSteps
from sainet.models.blocks import Place
from sainet.models.card import Card
from sainet.models.checkpoint import features_of, new_network, untrained
from sainet.models.correctors.contact import ContactNetwork
from sainet.models.correctors.interaction import InteractionNetwork
from sainet.models.correctors.network import AbstractNetwork, Scales, unit_scales
from sainet.models.features import AbstractFeatures, FeatureSet
from sainet.models.identity import ModelKind
from sainet.models.integrators import Acceleration, Integrator, RelaxingResidual

_STATISTICS_PUSHES = 500  # enough for means and deviations, at any size of store


@dataclass(frozen=True)
class Existing:
    """The network from which training starts."""

    network: AbstractNetwork
    card: Card
    folder: Path


@dataclass(frozen=True)
class Task:
    """Training job: model, data, recipe."""

    model: ModelKind
    store: Store
    recipe: Recipe
    assumed: InternalEngine
    existing: Existing | None = None  # the network of the start `FromModel`

    @property
    def is_additive(self) -> bool:
        """Whether a new network adds to the motion of its internal engine."""
        return isinstance(self.recipe.start, FromSimulator)

    @property
    def iterations(self) -> int:
        """The number of iterations."""
        return self.recipe.optimiser.iterations

    @property
    def has_single_steps(self) -> bool:
        """Whether pushes are cut into single steps."""
        return isinstance(self.recipe.horizon, SingleSteps)

    @property
    def inner(self) -> InternalEngine | None:
        """The internal engine of the network, if it has one."""
        return self.assumed if self.model == "sain" else None

    @property
    def names(self) -> tuple[str, ...]:
        """The arrays of the store that training reads."""
        return self._prediction.names

    @property
    def _prediction(self) -> Prediction:
        return Prediction(self.assumed, self.store.info)

    @property
    def features(self) -> AbstractFeatures:
        """The inputs of the network."""
        info = self.store.info
        return features_of(
            self.recipe.features,
            info.kind,
            simulator=self.model == "sain",
            time_step=info.time_step,
            disks=info.bodies,
        )

    @property
    def integrator(self) -> Integrator:
        """The integrator of a new network."""
        return RelaxingResidual() if self.is_additive else Acceleration()

    @cached_property
    def training(self) -> Store:
        """The pushes to train on."""
        return self.store.take(self._split[0]) if self.validation else self.store

    @cached_property
    def validation(self) -> Store | None:
        """The pushes kept for validation, if any."""
        kept = self._split[1]
        return self.store.take(kept) if len(kept) else None

    @cached_property
    def _split(self) -> tuple[np.ndarray, np.ndarray]:
        share = self.recipe.stopping.validation_share
        return split_rows(self.store.repeats(), share, self.recipe.seed)

    @property
    def short_steps(self) -> int:
        """Steps of pushes in the first iterations: a quarter of those trained on."""
        return -(-min(self.recipe.horizon.steps, self.store.info.steps) // 4)

    def complete(self, arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return stored arrays with the simulator prediction that the network takes."""
        return arrays if self.inner is None else self._prediction.complete(arrays)

    def to_batch(self, arrays: dict[str, np.ndarray], steps: int) -> PushBatch:
        """Return the batch of stored arrays, with the inputs of the network."""
        return self._batch(arrays, steps, self.inner)

    def to_training_batch(
        self, arrays: dict[str, np.ndarray], steps: int, iteration: int
    ) -> PushBatch:
        """Return the batch of stored arrays for an iteration, some of it mirrored."""
        if iteration <= self.recipe.horizon.short_iterations:
            steps = min(steps, self.short_steps)
        return self.augmented(self.to_batch(arrays, steps), iteration)

    def augmented(self, batch: PushBatch, iteration: int) -> PushBatch:
        """Return the batch of an iteration, some of it mirrored by the recipe."""
        if not self.recipe.augmentation.mirror or self.features.has_place:
            return batch
        return mirror_some(batch, self.recipe.seed, iteration)

    def to_sample(self, arrays: dict[str, np.ndarray]) -> PushBatch:
        """Return the batch for statistics: s-bar replaces an unknown truth."""
        return self._batch(arrays, self.store.info.steps, self.assumed)

    def _batch(
        self, arrays: dict[str, np.ndarray], steps: int, inner: InternalEngine | None
    ) -> PushBatch:
        info, steps = self.store.info, min(steps, self.recipe.horizon.steps)
        if inner is None:
            batch = to_batch(arrays, info, steps=steps)
        else:
            batch = self._prediction.batch(arrays, steps)
        if not self.has_single_steps:
            return batch
        # IN's statistics are of a simulated path too, but not of its single steps.
        return to_single_steps(
            batch, self.inner.simulator.build() if self.inner else None
        )


def settings(task: Task) -> dict[str, object]:
    """Return the settings that decide the weights, as JSON values."""
    recipe = msgspec.to_builtins(task.recipe.settings())
    del recipe["checkpoint_every"]
    if not task.recipe.stopping.validation_share:  # else each line of the log validates
        del recipe["log_every"]
    start = {"start": task.existing.card.weights} if task.existing else {}
    start = {"start": FROM_ENGINE} if task.is_additive else start
    return {
        "command": "train",
        "model": task.model,
        "internal_engine": task.assumed.settings,
        "data": task.store.content,
        **start,
        **recipe,
    }


def statistics(task: Task) -> tuple[Scales, LossWeights]:
    """Return the scales of a network and the weights of the loss, from the data."""
    store = task.training
    few = slice(0, min(_STATISTICS_PUSHES, store.info.pushes))
    sample = task.to_sample(store.read(few, task.names))
    features = task.features
    scales = (
        feature_scales(sample, features, task.integrator)
        if features.are_standardised
        else unit_scales(features)
    )
    return scales, loss_weights(sample, task.recipe.objective)


def first_network(task: Task, scales: Scales) -> AbstractNetwork:
    """Return the network that training begins with."""
    if task.existing is None:
        return new_network(
            task.features,
            task.store.info.time_step,
            task.integrator,
            key=jax.random.key(task.recipe.seed),
            scales=scales,
            hold=task.recipe.horizon.hold,
        )
    network = task.existing.network
    if isinstance(network, ContactNetwork):
        return network.held(task.recipe.horizon.hold)
    if task.features == network.features:
        return network
    assert isinstance(network, InteractionNetwork)
    return widen(network, scales)


def widen(network: InteractionNetwork, scales: Scales) -> InteractionNetwork:
    """Return a network that also takes the place on the table; its output is equal.

    The new features enter the first layer of f_dyn with weights of zero: they have no
    effect until training changes that.

    Args:
        network: with the paper's features.
        scales: of the new features, from the training data; the other features keep
            their scales.
    """
    known, kept = network.features.body_size, network.scales
    weight = network.dyn.weights[0]
    added = scales.body_mean.shape[0] - known
    silent = jnp.zeros((added, weight.shape[1]), weight.dtype)
    # The features of the body come first, then the summed effects.
    wider = jnp.concatenate([weight[:known], silent, weight[known:]])
    dyn = eqx.tree_at(lambda layers: layers.weights[0], network.dyn, wider)
    mean = jnp.concatenate([kept.body_mean, scales.body_mean[known:]])
    deviation = jnp.concatenate([kept.body_deviation, scales.body_deviation[known:]])
    widened = eqx.tree_at(
        lambda s: (s.body_mean, s.body_deviation), kept, (mean, deviation)
    )
    features = FeatureSet((*network.features.blocks, Place()))
    wide = untrained(features, network.time_step, network.integrator)
    assert isinstance(wide, InteractionNetwork)
    return eqx.tree_at(
        lambda n: (n.rel, n.dyn, n.scales), wide, (network.rel, dyn, widened)
    )
