"""A store of some of its pushes: for learning curves, validation and folds."""

import numpy as np
import pytest

from learning.stores import info_of, made_up, write
from sainet.runs.errors import BadInput


@pytest.fixture
def store(tmp_path):
    info = info_of(12)
    return write(tmp_path / "data", info, made_up(info))


def test_the_first_pushes_equal_those_of_the_store(store):
    few = store.first(7)
    assert (few.info.pushes, few.info.chunks) == (7, 2)
    for part in (slice(None), slice(5, 99), slice(-2, None)):
        found, wanted = few.read(part), store.read(slice(0, 7))
        for name, array in found.items():
            np.testing.assert_array_equal(array, wanted[name][part])


def test_other_pushes_have_another_content_hash(store):
    contents = {store.first(n).content for n in (1, 7, 12)}
    assert len(contents) == 3
    assert store.first(12).content == store.content


@pytest.mark.parametrize(
    ("pushes", "words"),
    [(0, "`pushes` is 0; it must be at least 1"), (13, "has 12 pushes, not 13")],
)
def test_more_pushes_than_stored_are_refused(store, pushes, words):
    with pytest.raises(BadInput, match=words):
        store.first(pushes)


def test_any_pushes_can_be_taken_in_any_order_and_again(store):
    rows = [5, 0, 11, 5]
    some, whole = store.take(rows), store.read(slice(None))
    assert some.info.pushes == 4
    for part in (slice(None), slice(1, 3)):
        for name, array in some.read(part).items():
            np.testing.assert_array_equal(array, whole[name][rows][part])
    again = some.take([2, 1])
    np.testing.assert_array_equal(
        again.read(slice(None), ("truth",))["truth"], whole["truth"][[11, 0]]
    )


def test_the_content_hash_depends_on_the_taken_pushes(store):
    contents = {store.take(rows).content for rows in ([0, 1], [1, 0], [0, 2], [3])}
    assert len(contents) == 4
    assert store.take([0, 1]).content == store.first(2).content
    assert store.take(range(12)).content == store.content
    some = store.take([5, 3])
    assert some.take([0, 1]).content == some.content


@pytest.mark.parametrize(
    ("rows", "says"),
    [([], "no push was chosen"), ([0, 12], "no push 12"), ([-1], "-1")],
)
def test_only_stored_pushes_can_be_taken(store, rows, says):
    with pytest.raises(BadInput, match=says):
        store.take(rows)


@pytest.mark.parametrize(
    "rows", [np.arange(12) > 5, [True, False], np.array([1.5]), np.array([[0, 1]])]
)
def test_masks_and_fractions_are_no_indices(store, rows):
    with pytest.raises(BadInput, match=r"`rows` is .*; it must be whole numbers"):
        store.take(rows)
