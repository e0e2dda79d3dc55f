"""Batches of stored pushes, in a random order set by seed and iteration."""

from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from sainet.datasets.batch import shared_lengths
from sainet.datasets.schema import Arrays
from sainet.datasets.store import Store

_WINDOW = 8  # chunks shuffled together
_ORDER_STREAM = 0x0DE5


@dataclass
class ChunkCache:
    """Cache of the most recently used chunks of some arrays, up to a memory limit.

    `complete` adds computed arrays to the stored arrays of a chunk.
    """

    store: Store
    names: tuple[str, ...]
    limit: int  # bytes
    complete: Callable[[Arrays], Arrays] = lambda arrays: arrays
    _chunks: OrderedDict[int, Arrays] = field(default_factory=OrderedDict)
    _size: int = 0

    def get(self, index: int) -> Arrays:
        """Return one chunk, read from disk if it is not in the cache."""
        if index not in self._chunks:
            rows = self.store.info.chunk_slice(index)
            chunk = self.complete(self.store.read(rows, self.names))
            self._chunks[index] = chunk
            self._size += _bytes(chunk)
        self._chunks.move_to_end(index)
        while self._size > self.limit and len(self._chunks) > 1:
            self._size -= _bytes(self._chunks.popitem(last=False)[1])
        return self._chunks[index]

    def gather(self, pushes: np.ndarray) -> Arrays:
        """Return the arrays of some pushes, in the given order."""
        owners = pushes // self.store.info.chunk_size
        picked: Arrays = {}
        for owner in np.unique(owners):
            here = np.flatnonzero(owners == owner)
            rows = pushes[here] - owner * self.store.info.chunk_size
            for name, array in self.get(int(owner)).items():
                shape = (len(pushes), *array.shape[1:])
                picked.setdefault(name, np.empty(shape, array.dtype))[here] = array[
                    rows
                ]
        return picked


def _bytes(chunk: Arrays) -> int:
    return sum(array.nbytes for array in chunk.values())


@dataclass
class BatchReader:
    """Reader of batches of pushes of similar length, without loading the whole store.

    The pushes of a batch depend only on the seed and the iteration, so that a resumed
    training run reads the same batches. `complete` adds computed arrays to the stored
    arrays of a chunk.
    """

    store: Store
    names: tuple[str, ...]
    batch_size: int
    seed: int
    memory: int = 1 << 30  # bytes
    complete: Callable[[Arrays], Arrays] = lambda arrays: arrays

    def __post_init__(self) -> None:
        """Read the lengths and start the thread that reads ahead."""
        self._cache = ChunkCache(self.store, self.names, self.memory, self.complete)
        steps = self.store.read(slice(None), ("steps",))["steps"]
        self._steps = shared_lengths(steps)
        self._order = lru_cache(maxsize=2)(self._batches_of_epoch)
        self._thread = ThreadPoolExecutor(1)
        self._ahead: dict[int, object] = {}

    def batch(self, iteration: int) -> tuple[Arrays, int]:
        """Return the arrays of a batch and the number of steps of its pushes."""
        ready = self._ahead.pop(iteration, None)
        ready = ready or self._thread.submit(self._read, iteration)
        self._ahead = {iteration + 1: self._thread.submit(self._read, iteration + 1)}
        return ready.result()  # pyright: ignore[reportAttributeAccessIssue]

    def close(self) -> None:
        """Stop reading ahead."""
        self._thread.shutdown(cancel_futures=True)

    @property
    def is_even(self) -> bool:
        """Whether all pushes have as many steps."""
        return len(np.unique(self._steps)) == 1

    def whole(self) -> Arrays:
        """Return the arrays of all pushes."""
        return self._cache.gather(np.arange(self.store.info.pushes))

    def _read(self, iteration: int) -> tuple[Arrays, int]:
        chosen = self.rows(iteration)
        return self._cache.gather(chosen), int(self._steps[chosen[0]])

    def rows(self, iteration: int) -> np.ndarray:
        """Return the pushes of a batch."""
        epoch, place = 0, iteration
        while place >= len(self._order(epoch)):
            whole = len(self._order(epoch))
            epoch, place = epoch + place // whole, place % whole
        return self._order(epoch)[place]

    def _batches_of_epoch(self, epoch: int) -> list[np.ndarray]:
        """Return the batches of an epoch: shuffled chunks, then shuffled pushes."""
        rng = np.random.default_rng([_ORDER_STREAM, self.seed, epoch])
        info = self.store.info
        chunks = rng.permutation(info.chunks)
        batches = []
        for start in range(0, len(chunks), _WINDOW):
            window = [
                np.arange(info.pushes)[info.chunk_slice(int(c))]
                for c in chunks[start : start + _WINDOW]
            ]
            batches.append(rng.permutation(np.concatenate(window)))
        return self._cut(np.concatenate(batches))

    def _cut(self, order: np.ndarray) -> list[np.ndarray]:
        """Return whole batches of similar length; pushes of rare lengths repeat."""
        batches = []
        for steps in np.unique(self._steps):
            same = order[self._steps[order] == steps]
            short = max(self.batch_size - len(same), 0)
            same = np.concatenate([same, np.resize(same, short)])
            whole = len(same) // self.batch_size
            batches += np.split(same[: whole * self.batch_size], whole)
        place = {int(push): at for at, push in enumerate(order)}
        return sorted(batches, key=lambda batch: place[int(batch[0])])
