"""Datasets made from others."""

import numpy as np
import pytest

from learning.stores import info_of, made_up, write
from sainet.datasets.store import open_store
from sainet.datasets.writer import derive
from sainet.runs.errors import RunConflict


@pytest.fixture
def store(tmp_path):
    info = info_of(12)
    return write(tmp_path / "data", info, made_up(info))


def every_other(arrays):
    return {name: array[::2] for name, array in arrays.items()}


def test_a_derived_store_is_like_any_other(store, tmp_path):
    found = derive(store, tmp_path / "half", {"kept": "even"}, every_other)
    assert (found.info.pushes, found.info.seed) == (6, store.info.seed)
    for name, array in open_store(tmp_path / "half").read(slice(None)).items():
        np.testing.assert_array_equal(array, store.read(slice(None))[name][::2])


def test_a_derived_store_is_made_once_and_only_from_its_data(store, tmp_path):
    out, told = tmp_path / "half", {"kept": "even"}
    first = derive(store, out, told, every_other)

    def never(arrays):
        raise AssertionError

    assert derive(store, out, told, never).content == first.content
    for data, settings in ((store.first(5), told), (store, {"kept": "odd"})):
        with pytest.raises(RunConflict):
            derive(data, out, settings, never)
