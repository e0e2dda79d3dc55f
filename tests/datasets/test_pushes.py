"""Content hashes: one push has one hash in every store, other pushes have others."""

import numpy as np
import pytest

from learning.stores import info_of, made_up, write
from sainet.datasets.splits import split
from sainet.runs.digests import digests_from_text, digests_to_text, pushes_overlap
from sainet.runs.errors import BadInput

INFO = info_of(12)


@pytest.fixture(scope="module")
def arrays():
    return made_up(INFO, lengths=[4, 7, 12] * 4)


@pytest.fixture(scope="module")
def store(arrays, tmp_path_factory):
    return write(tmp_path_factory.mktemp("hashes") / "data", INFO, arrays)


def test_every_push_has_its_own_hash_wherever_it_is_read(store):
    hashes = store.push_hashes()
    assert len(set(hashes.tolist())) == 12
    rows = [7, 0, 11, 3]
    np.testing.assert_array_equal(store.take(rows).push_hashes(), hashes[rows])


def test_another_import_of_the_same_pushes_has_the_same_hashes(arrays, store, tmp_path):
    """Other properties, predictions and chunks; pushes of up to 7 steps only."""
    rows = np.flatnonzero(arrays["steps"] < 12)
    other = {
        name: array[rows, :7] if array.shape[1:2] == (12,) else array[rows]
        for name, array in arrays.items()
    }
    other |= {"mass": other["mass"] * 2, "simulated_planar": -other["simulated_planar"]}
    info = info_of(len(rows), steps=7, chunk_size=3)
    found = write(tmp_path / "other", info, other).push_hashes()
    np.testing.assert_array_equal(found, store.push_hashes()[rows])


@pytest.mark.parametrize("name", ["initial", "initial_pusher", "command_position"])
def test_a_changed_start_or_command_changes_the_hash(arrays, store, tmp_path, name):
    changed = arrays[name].copy()
    changed[3].flat[1] += 1e-5
    found = write(tmp_path / "changed", INFO, arrays | {name: changed}).push_hashes()
    assert np.flatnonzero(found != store.push_hashes()).tolist() == [3]


def test_forces_are_hashed(arrays, tmp_path):
    info = info_of(12, kind="direct-force")
    forces = {
        "force": arrays["truth_pusher"],
        "contact_offset": arrays["initial_pusher"],
    }
    one = write(tmp_path / "one", info, arrays | forces).push_hashes()
    forces["force"] = forces["force"] + 1e-3
    other = write(tmp_path / "other", info, arrays | forces).push_hashes()
    assert (one != other).all()


def test_training_pushes_are_found_in_the_whole_and_not_in_the_rest(store):
    train, tests = split(store, 0.25)
    trained = digests_to_text(train.push_hashes())
    assert len(trained) == 8 * 9
    assert pushes_overlap(trained, store.push_hashes()) == 9
    assert pushes_overlap(trained, tests.push_hashes()) == 0
    assert pushes_overlap("", store.push_hashes()) == 0


def test_digests_survive_as_text(store):
    hashes = store.push_hashes()
    found = digests_from_text(digests_to_text(hashes[::-1]))
    np.testing.assert_array_equal(found, np.sort(hashes))


@pytest.mark.parametrize("text", ["?", "AAAA", "AAAAA", "é"])
def test_damaged_digests_are_refused(text):
    with pytest.raises(BadInput, match="damaged; train again"):
        pushes_overlap(text, np.zeros(1, np.uint64))
