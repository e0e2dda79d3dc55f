"""A store cut to its first pushes: what a learning curve is made of."""

import numpy as np
import pytest

from sainet.errors import BadInput
from training.stores import info_of, made_up, write


@pytest.fixture
def store(tmp_path):
    info = info_of(12)
    return write(tmp_path / "data", info, made_up(info))


def test_the_first_pushes_are_those_of_the_whole(store):
    few = store.first(7)
    assert (few.info.pushes, few.info.chunks) == (7, 2)
    for part in (slice(None), slice(5, 99), slice(-2, None)):
        found, wanted = few.read(part), store.read(slice(0, 7))
        for name, array in found.items():
            np.testing.assert_array_equal(array, wanted[name][part])


def test_other_pushes_are_other_content(store):
    contents = {store.first(n).content for n in (1, 7, 12)}
    assert len(contents) == 3
    assert store.first(12).content == store.content


@pytest.mark.parametrize("pushes", [0, -1, 13])
def test_a_store_has_no_more_than_it_has(store, pushes):
    with pytest.raises(BadInput, match=f"has 12 pushes, not {pushes}"):
        store.first(pushes)
