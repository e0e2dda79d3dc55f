"""Where the batches of a job come from: its dataset, or the memory of a GPU."""

from abc import ABC, abstractmethod
from weakref import WeakValueDictionary

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from sainet.datasets.batch import PushBatch
from sainet.datasets.reader import BatchReader
from sainet.engines.devices import is_one_gpu
from sainet.learning.task import Task

_MOST = 4 << 30  # bytes that a dataset may take of the memory of a GPU
_NUMBERS = 4 * 6 * 4  # bytes of a disk at a step: motion, twice predicted, observed


class Source(ABC):
    """Gives the batches of one dataset, in the order that the seed of a job decides."""

    def __init__(self, task: Task, reader: BatchReader) -> None:
        """Store the job and the reader of its dataset."""
        self._task, self._reader = task, reader

    @abstractmethod
    def take(self, place: int, iteration: int) -> PushBatch:
        """Return a batch, by its place in the order of this dataset."""

    def close(self) -> None:
        """Stop reading ahead."""
        self._reader.close()


def source_of(task: Task) -> Source:
    """Return the batches of a training job."""
    size, seed = task.recipe.optimiser.batch_size, task.recipe.seed
    reader = BatchReader(task.training, task.names, size, seed, complete=task.complete)
    return Resident(task, reader) if _can_stay(task, reader) else Read(task, reader)


def _can_stay(task: Task, reader: BatchReader) -> bool:
    info, horizon = task.store.info, task.recipe.horizon
    is_plain = reader.is_even and not task.has_single_steps
    size = info.pushes * info.steps * info.bodies * _NUMBERS
    return is_one_gpu() and is_plain and not horizon.short_iterations and size < _MOST


class Read(Source):
    """Batches that are read from the dataset, one ahead."""

    def take(self, place: int, iteration: int) -> PushBatch:
        """Return a batch, by its place in the order of this dataset."""
        return self._task.to_training_batch(*self._reader.batch(place), iteration)


class Resident(Source):
    """Batches that are picked from the dataset on the device.

    Reading and transferring a batch takes longer than a GPU trains on it.
    """

    def __init__(self, task: Task, reader: BatchReader) -> None:
        """Transfer the dataset."""
        super().__init__(task, reader)
        key = task.training.content, repr(task.inner), task.recipe.horizon.steps
        known = _residents.get(key)
        self._whole = known or task.to_batch(reader.whole(), task.store.info.steps)
        _residents[key] = self._whole

    def take(self, place: int, iteration: int) -> PushBatch:
        """Return a batch, by its place in the order of this dataset."""
        batch = _pick(self._whole, jnp.asarray(self._reader.rows(place)))
        return self._task.augmented(batch, iteration)


# Networks that train at once share what is equal, while one of them needs it.
_residents = WeakValueDictionary[tuple[str, str, int], PushBatch]()


@jax.jit
def _pick(whole: PushBatch, rows: Int[Array, " push"]) -> PushBatch:
    return jax.tree.map(lambda x: x[rows], whole)
