"""Divisions of recorded pushes into folds: what test pushes lack."""

from typing import get_args

import numpy as np
import pytest
from msgspec import structs

from learning.stores import info_of, made_up, write
from sainet.datasets import Scheme
from sainet.datasets.chains import linked
from sainet.datasets.folds import BLOCKED, folds_by
from sainet.runs.errors import BadStore

PUSHES, FOLDS = 40, 4
EVERY = np.arange(PUSHES)
PLACED = ("initial", "initial_pusher", "command_position")
SAME = ("initial_pusher", "command_position", "repeat")


def spread(seed=0, around=None):
    """Pushes of one disk all over the table, from all sides, in all directions.

    Sides and directions (rad) are random, or as given.
    """
    rng = np.random.default_rng(seed)
    info = info_of(PUSHES, bodies=1, has_repeats=True)
    arrays = made_up(info, seed=seed)
    place = rng.uniform([-0.3, -0.05], [0.3, 0.05], (PUSHES, 2))
    angle, side, ahead = rng.uniform(-np.pi, np.pi, (3, PUSHES))
    side, ahead = (side, ahead) if around is None else (around, around)
    normal = np.stack([np.cos(side + angle), np.sin(side + angle)], axis=-1)
    pusher = place - 0.06 * normal
    heading = np.stack([np.cos(ahead), np.sin(ahead)], axis=-1)
    path = pusher[:, None] + 0.001 * np.arange(1, 13)[:, None] * heading[:, None]
    initial = np.zeros((PUSHES, 1, 6))
    initial[:, 0, :2], initial[:, 0, 2] = place, angle
    arrays |= {"initial": initial, "initial_pusher": pusher, "command_position": path}
    values = {"place": place[:, 0], "direction": ahead, "side": side}
    arrays |= {"repeat": np.arange(PUSHES) // 2}
    return info, arrays, values | {"order": EVERY}


@pytest.fixture(scope="module")
def spread_out(tmp_path_factory):
    info, arrays, values = spread()
    return write(tmp_path_factory.mktemp("spread") / "data", info, arrays), values


@pytest.mark.parametrize("scheme", BLOCKED)
def test_blocks_are_ranges_of_equal_size(spread_out, scheme):
    store, values = spread_out
    owner = folds_by(store, scheme, FOLDS, EVERY)
    assert np.bincount(owner).tolist() == [PUSHES // FOLDS] * FOLDS
    in_order = owner[np.argsort(np.mod(values[scheme], 2 * np.pi))]
    if scheme in ("place", "order"):
        in_order = owner[np.argsort(values[scheme])]
        assert in_order[0] != in_order[-1]
    assert (in_order != np.roll(in_order, 1)).sum() == FOLDS


def test_folds_by_place_do_not_depend_on_where_the_origin_is(spread_out, tmp_path):
    store, _ = spread_out
    info, arrays, _ = spread()
    for name in SAME[:2]:
        arrays[name] = arrays[name] + [1.0, 3.0]
    arrays["initial"][..., :2] += [1.0, 3.0]
    moved = write(tmp_path / "data", info, arrays)
    owner, found = (folds_by(s, "place", FOLDS, EVERY) for s in (store, moved))
    assert len({*zip(owner, found, strict=True)}) == FOLDS


@pytest.mark.parametrize("scheme", ["place", "side"])
def test_blocks_are_of_the_disk_that_is_pushed(spread_out, tmp_path, scheme):
    """Which body it is varies: beside it is another that nothing touches."""
    store, _ = spread_out
    info, arrays, _ = spread()
    aside = np.random.default_rng(1).uniform(-0.5, 0.5, (PUSHES, 1, 6))
    aside[..., 1] += 2.0  # m
    both = np.concatenate([arrays["initial"], aside], axis=1)
    both[::2] = both[::2, ::-1]
    wider = structs.replace(info, bodies=2)
    arrays = made_up(wider, seed=0) | {k: arrays[k] for k in SAME} | {"initial": both}
    owner = folds_by(write(tmp_path / "data", wider, arrays), scheme, FOLDS, EVERY)
    assert (owner == folds_by(store, scheme, FOLDS, EVERY)).all()


@pytest.mark.parametrize("scheme", ["direction", "side"])
@pytest.mark.parametrize("turned", [0.0, 0.5, np.pi / 4, 3.0])
def test_no_direction_is_cut_where_the_angle_jumps(tmp_path, scheme, turned):
    """Eight nominal directions, measured to a milliradian, fill four folds."""
    number = EVERY % 8
    noise = np.random.default_rng(0).normal(0, 1e-3, PUSHES)
    info, arrays, _ = spread(around=turned + number * np.pi / 4 + noise)
    owner = folds_by(write(tmp_path / "data", info, arrays), scheme, FOLDS, EVERY)
    assert all(len(set(owner[number == n])) == 1 for n in range(8))


def test_repeats_and_chains_stay_together(tmp_path):
    info, arrays, _ = spread()
    # Push 3 starts where push 10 ended: a chain of two pairs of repeats.
    arrays["initial"][3] = arrays["truth"][10, -1]
    store = write(tmp_path / "data", info, arrays)
    assert linked(store)[3] == linked(store)[10]
    for scheme, together in (("kind", [2, 3]), ("chain", [2, 3, 10, 11])):
        owner = folds_by(store, scheme, FOLDS, EVERY)
        assert len(set(owner[together])) == 1
        assert set(owner) == set(range(FOLDS))


@pytest.mark.parametrize("scheme", get_args(Scheme))
def test_copies_stay_together(tmp_path, scheme):
    """Of a push that was stored first and last, no model is tested on the copy."""
    info, arrays, _ = spread()
    first = np.append(EVERY[:-1], 0)
    repeats = np.arange(PUSHES)
    copied = {name: np.asarray(each)[first] for name, each in arrays.items()}
    store = write(tmp_path / "data", info, copied | {"repeat": repeats})
    owner = folds_by(store, scheme, FOLDS, EVERY)
    assert owner[0] == owner[-1]
    assert set(owner) == set(range(FOLDS))


@pytest.mark.parametrize("scheme", ["place", "direction", "side"])
def test_equal_values_are_not_parted(tmp_path, scheme):
    """Of two directions, one is in three quarters of all pushes: no fold has both."""
    info, arrays, _ = spread()
    some, many = EVERY[:1].repeat(PUSHES // 4), EVERY[1:2].repeat(3 * PUSHES // 4)
    rows = np.concatenate([some, many])
    two = {k: np.asarray(v)[rows] if k in PLACED else v for k, v in arrays.items()}
    store = write(tmp_path / "data", info, two)
    assert len({*zip(rows, folds_by(store, scheme, 2, EVERY), strict=True)}) == 2
    with pytest.raises(BadStore, match=f"2 of them different by {scheme}.*fewer folds"):
        folds_by(store, scheme, 3, EVERY)
    with pytest.raises(BadStore, match=rf"1 of them different by {scheme}.*take anoth"):
        folds_by(store, scheme, 2, EVERY[-20:])


@pytest.mark.parametrize("scheme", ["place", "direction", "side"])
def test_pairs_of_equal_values_fill_equal_folds(tmp_path, scheme):
    info, arrays, _ = spread()
    pairs = {k: np.asarray(arrays[k])[EVERY // 2] for k in (*PLACED, "repeat")}
    store = write(tmp_path / "data", info, arrays | pairs)
    owner = folds_by(store, scheme, FOLDS, EVERY)
    assert np.bincount(owner).tolist() == [PUSHES // FOLDS] * FOLDS
    assert (owner[::2] == owner[1::2]).all()


def test_pushes_that_hardly_differ_in_place_are_refused(tmp_path):
    info, arrays, _ = spread()
    near = np.random.default_rng(2).uniform(-1e-4, 1e-4, (PUSHES, 2))  # m
    arrays["initial"][:, 0, :2] = near
    store = write(tmp_path / "data", info, arrays)
    with pytest.raises(BadStore, match="different by place"):
        folds_by(store, "place", FOLDS, EVERY)


def test_a_part_has_the_kinds_of_the_whole_and_blocks_of_its_own(spread_out):
    store, _ = spread_out
    rows = np.arange(5, 35)
    kinds = folds_by(store, "kind", FOLDS, EVERY)
    assert (folds_by(store, "kind", FOLDS, rows) == kinds[rows]).all()
    sizes = np.bincount(folds_by(store, "place", FOLDS, rows))
    assert sizes.min() >= len(rows) // FOLDS


@pytest.mark.parametrize("scheme", get_args(Scheme))
def test_too_few_pushes_are_refused(spread_out, scheme):
    store, _ = spread_out
    with pytest.raises(BadStore, match=rf"2 pushes.*by {scheme}.*another division"):
        folds_by(store, scheme, 3, EVERY[:2])
