"""Batches for training: random, repeatable, of few lengths, never the whole store."""

from itertools import islice

import numpy as np
import pytest

from learning.stores import info_of, made_up, write
from sainet.datasets.reader import BatchReader, ChunkCache

PUSHES, CHUNK = 40, 5
NAMES = ("mass", "truth", "steps")


@pytest.fixture(scope="session")
def store(tmp_path_factory):
    info = info_of(PUSHES, chunk_size=CHUNK)
    return write(tmp_path_factory.mktemp("reader"), info, made_up(info))


@pytest.fixture(scope="session")
def mixed_store(tmp_path_factory):
    """30 pushes of 12 steps, 8 of 6 and 2 of 3."""
    info = info_of(PUSHES, chunk_size=CHUNK)
    lengths = np.random.default_rng(0).permutation([12] * 30 + [6] * 8 + [3] * 2)
    return write(tmp_path_factory.mktemp("mixed"), info, made_up(info, lengths))


@pytest.fixture
def make_reader():
    made = []

    def make(store, batch_size=8, seed=0, **settings):
        made.append(BatchReader(store, NAMES, batch_size, seed, **settings))
        return made[-1]

    yield make
    for reader in made:
        reader.close()


def which(batch) -> list[int]:
    """The indices of the pushes of a batch."""
    return [round(mass) - 1 for mass in batch[0]["mass"][:, 0].tolist()]


def first(reader, count) -> list[list[int]]:
    return [which(reader.batch(i)) for i in range(count)]


def test_a_batch_contains_the_stored_values(store, make_reader):
    whole = store.read(slice(None), NAMES)
    arrays, steps = make_reader(store).batch(0)
    chosen = which((arrays, steps))
    assert steps == 12
    for name in NAMES:
        np.testing.assert_array_equal(arrays[name], whole[name][chosen])


def test_computed_arrays_are_added_to_each_chunk_once(store, make_reader):
    seen = []

    def complete(arrays):
        seen.append(len(arrays["mass"]))
        return arrays | {"double": 2 * arrays["mass"]}

    reader = make_reader(store, complete=complete)
    for iteration in range(10):
        arrays, _ = reader.batch(iteration)
        np.testing.assert_array_equal(arrays["double"], 2 * arrays["mass"])
    assert sum(seen) == PUSHES


def test_the_order_depends_only_on_seed_and_iteration(store, make_reader):
    wanted = first(make_reader(store), 12)
    assert first(make_reader(store), 12) == wanted
    assert first(make_reader(store, seed=1), 12) != wanted
    for iteration in (1, 4, 5, 11):  # a training that goes on
        reader = make_reader(store)
        assert which(reader.batch(iteration)) == wanted[iteration]
        later = [which(reader.batch(i)) for i in range(iteration + 1, 12)]
        assert later == wanted[iteration + 1 :]
    reader = make_reader(store)
    assert [which(reader.batch(i)) for i in (7, 2, 2, 9)] == [
        wanted[i] for i in (7, 2, 2, 9)
    ]


def test_every_epoch_visits_each_push_once_in_another_order(store, make_reader):
    batches = first(make_reader(store), 15)
    epochs = [sum(batches[i : i + 5], []) for i in (0, 5, 10)]
    for epoch in epochs:
        assert sorted(epoch) == list(range(PUSHES))
    assert len({tuple(epoch) for epoch in epochs}) == 3


def test_validation_pushes_are_never_read(store, make_reader):
    seen = sum(first(make_reader(store.first(33)), 12), [])
    assert set(seen) == set(range(33))


def test_long_pushes_are_never_mixed_with_those_of_half_their_length(
    mixed_store, make_reader
):
    lengths = mixed_store.read(slice(None), ("steps",))["steps"]
    reader = make_reader(mixed_store, batch_size=4)
    read = {12: set(), 6: set()}
    for batch in map(reader.batch, range(30)):
        read[batch[1]] |= set(lengths[which(batch)])
    assert read == {12: {12}, 6: {6, 3}}


def test_long_and_short_pushes_alternate_within_an_epoch(mixed_store, make_reader):
    """Not all short ones first: training would end every epoch with long pushes."""
    orders = []
    for seed in range(6):
        reader = make_reader(mixed_store, batch_size=4, seed=seed)
        orders.append([reader.batch(i)[1] for i in range(9)])  # 30 // 4 + 10 // 4
        assert sorted(orders[-1]) == [6] * 2 + [12] * 7
    places = np.array([np.flatnonzero(np.array(each) == 6) for each in orders])
    assert places.min() <= 1
    assert places.max() >= 5


def test_a_length_too_rare_for_a_batch_is_repeated(mixed_store, make_reader):
    lengths = mixed_store.read(slice(None), ("steps",))["steps"]
    reader = make_reader(mixed_store, batch_size=20)
    # An epoch: 30 // 20 batches of 12 steps, and one of up to 6 steps.
    (rare,) = [which(b) for b in map(reader.batch, range(2)) if b[1] == 6]
    assert sorted(rare) == sorted([*np.flatnonzero(lengths < 12)] * 2)


def test_a_batch_may_be_larger_than_the_store(store, make_reader):
    batch = which(make_reader(store, batch_size=100).batch(0))
    counts = np.bincount(batch, minlength=PUSHES)
    assert len(batch) == 100
    assert set(counts) == {2, 3}


def test_memory_is_bounded(store, make_reader):
    chunk = sum(a.nbytes for a in store.read(slice(0, CHUNK), NAMES).values())
    reader = make_reader(store, memory=2 * chunk)
    wanted = first(make_reader(store), 10)
    for iteration in range(10):
        assert which(reader.batch(iteration)) == wanted[iteration]
    reader.close()
    assert len(reader._cache._chunks) <= 2
    assert reader._cache._size <= 2 * chunk


def test_the_cache_drops_the_least_recently_used_chunk(store, monkeypatch):
    read = []
    cls = type(store)
    original = cls.read

    def counted(self, pushes, names=None):
        read.append(pushes.start // CHUNK)
        return original(self, pushes, names)

    monkeypatch.setattr(cls, "read", counted)
    chunk = sum(a.nbytes for a in original(store, slice(0, CHUNK), NAMES).values())
    cache = ChunkCache(store, NAMES, 2 * chunk)
    for index in (0, 1, 0, 2, 0, 1):
        cache.get(index)
    assert read == [0, 1, 2, 1]
    tiny = ChunkCache(store, NAMES, 1)  # one chunk is always kept
    for index in (0, 0, 3):
        tiny.get(index)
        assert list(islice(tiny._chunks, 9)) == [index]
