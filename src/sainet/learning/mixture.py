"""Mixtures: training jobs of several datasets that train one network together.

The datasets differ in the number of disks. A batch has pushes of one dataset, so that
each number of disks is compiled once.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import UInt64

from sainet.datasets.batch import PushBatch
from sainet.datasets.store import Store
from sainet.learning.checks import check_apart, check_task
from sainet.learning.loss import CONSTANT, LossWeights, known_deviation
from sainet.learning.sources import source_of
from sainet.learning.step import FitState, data_loss, even_batch, first_state
from sainet.learning.task import Task, first_network, settings, statistics
from sainet.models.correctors.network import AbstractNetwork, Scales
from sainet.runs.documents import content_hash
from sainet.runs.errors import BadStore

Validate = Callable[[AbstractNetwork], float]
_TURN_STREAM = 0x7012


@dataclass(frozen=True)
class Mixture:
    """Training jobs of one network, which differ in their datasets only."""

    tasks: tuple[Task, ...]

    @property
    def lead(self) -> Task:
        """The job of the first dataset."""
        return self.tasks[0]

    @property
    def stores(self) -> list[Store]:
        """The datasets."""
        return [task.store for task in self.tasks]

    @property
    def pushes(self) -> int:
        """Pushes in all datasets."""
        return sum(store.info.pushes for store in self.stores)

    @property
    def counts(self) -> tuple[int, ...]:
        """Numbers of disks, each once."""
        return tuple(sorted({store.info.bodies for store in self.stores}))

    @property
    def content(self) -> str:
        """The hash of all datasets, as model cards record it."""
        contents = [store.content for store in self.stores]
        return (
            content_hash(" ".join(contents).encode()) if contents[1:] else contents[0]
        )

    def push_hashes(self) -> UInt64[np.ndarray, " push"]:
        """Return the hash of each push."""
        return np.concatenate([store.push_hashes() for store in self.stores])

    def settings(self) -> dict[str, object]:
        """Return the settings that decide the weights, as JSON values."""
        contents = [store.content for store in self.stores]
        found = settings(self.lead)
        return found | {"data": contents} if contents[1:] else found

    def check(self) -> None:
        """Check every job, and that the datasets belong together.

        Raises:
            BadStore: a dataset lacks inputs, differs from the first, or shares pushes
                with another one.
            BadInput: the recipe does not fit the model or the data.
            BadCheckpoint: training cannot start from its network.
        """
        check_apart(self.stores)
        first = self.lead.store
        for task in self.tasks:
            check_task(task)
            _check_alike(first, task.store)
            if task.features != self.lead.features:
                raise BadStore(
                    f"{task.store.path}: pushes of {task.store.info.bodies} disks, not "
                    f"{first.info.bodies}; a network on the whole state takes one "
                    "number of disks."
                )

    def begin(self) -> tuple[FitState, list[LossWeights]]:
        """Return the first state, and the weights of the loss for each dataset."""
        scales, weights = zip(*map(statistics, self.tasks), strict=True)
        pooled = pool(scales, [store.info.bodies for store in self.stores])
        network = first_network(self.lead, pooled)
        state = first_state(network, self.lead.recipe.optimiser)
        return state, [*weights]

    def validate(self, weights: Sequence[LossWeights]) -> Validate | None:
        """Return a function that measures the loss on the validation pushes, if any."""
        kept = [task.validation for task in self.tasks]
        if kept[0] is None:
            return None
        parts = []
        for task, store, of_loss in zip(self.tasks, kept, weights, strict=True):
            assert store is not None
            arrays = store.read(slice(None), task.names)
            parts.append((task.to_batch(arrays, task.store.info.steps), of_loss))
        known = sum(int(batch.is_observed.sum()) for batch, _ in parts)
        # All as arguments: XLA would spend seconds on folding constants of a closure.
        loss = jax.jit(data_loss)
        return lambda network: (
            sum(float(loss(network, *each)) for each in parts) / known
        )


def _check_alike(first: Store, other: Store) -> None:
    for name in ("kind", "time_step", "engine"):
        wanted, found = getattr(first.info, name), getattr(other.info, name)
        if wanted != found:
            raise BadStore(
                f"{other.path}: {name} is {found!r}, that of {first.path} is "
                f"{wanted!r}; train on datasets of one setup."
            )


def pool(scales: Sequence[Scales], bodies: Sequence[int]) -> Scales:
    """Return the statistics of several datasets of equal weight.

    Args:
        scales: of each dataset.
        bodies: in each push of it; pushes of one body have no pairs.
    """
    if not scales[1:]:
        return scales[0]
    paired = [each for each, count in zip(scales, bodies, strict=True) if count > 1]
    body = _pooled([(each.body_mean, each.body_deviation) for each in scales])
    pair = _pooled([(s.pair_mean, s.pair_deviation) for s in paired or scales])
    sizes = jnp.stack([each.acceleration for each in scales])
    known = jnp.where(sizes == CONSTANT, jnp.nan, sizes**2)
    size = jnp.nan_to_num(jnp.sqrt(jnp.nanmean(known, axis=0)), nan=CONSTANT)
    return Scales(*pair, *body, size)


def _pooled(each: Sequence[tuple[jax.Array, jax.Array]]) -> tuple[jax.Array, jax.Array]:
    means, deviations = (jnp.stack(x) for x in zip(*each, strict=True))
    mean = jnp.mean(means, axis=0)
    within = jnp.where(deviations == CONSTANT, 0.0, deviations) ** 2
    whole = jnp.mean(within + (means - mean[None]) ** 2, axis=0)
    return mean, known_deviation(mean, jnp.sqrt(whole))


class Batches:
    """The batches of a mixture: of which dataset each is depends on the seed only."""

    def __init__(self, mixture: Mixture) -> None:
        """Draw the order of the datasets, in proportion to their pushes."""
        recipe, counts = mixture.lead.recipe, [s.info.pushes for s in mixture.stores]
        rng = np.random.default_rng([_TURN_STREAM, recipe.seed])
        share = np.array(counts) / sum(counts)
        total = mixture.lead.iterations
        self._turn = rng.choice(len(counts), total, p=share)
        same = self._turn[:, None] == np.arange(len(counts))
        self._place = np.cumsum(same, axis=0) - 1
        self._sources = [source_of(task) for task in mixture.tasks]

    def take(self, iteration: int) -> tuple[int, PushBatch]:
        """Return the index of a dataset, and its batch for an iteration (from 1)."""
        turn = int(self._turn[iteration - 1])
        place = int(self._place[iteration - 1, turn])
        return turn, even_batch(self._sources[turn].take(place, iteration))

    def close(self) -> None:
        """Stop reading ahead."""
        for source in self._sources:
            source.close()
