"""Folds: every push is tested once, by what saw no repeat of it."""

import numpy as np
import pytest

from learning.stores import end_points_alone, info_of, made_up, write
from sainet.datasets.splits import fold_of_push, make_folds
from sainet.evaluation.as_json import to_json_object
from sainet.evaluation.evaluate import evaluate
from sainet.evaluation.joining import join_folds
from sainet.evaluation.summary import summarise
from sainet.models.library import load_model

REPEATS = np.random.default_rng(0).permutation(np.repeat(np.arange(9), 3))


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    info = info_of(27, engine="recorded", seed=None, has_repeats=True, bodies=1)
    arrays = end_points_alone(made_up(info)) | {"repeat": REPEATS}
    return write(tmp_path_factory.mktemp("folds") / "data", info, arrays)


def test_every_push_is_tested_once_and_repeats_stay_together(store):
    folds = make_folds(store, 3)
    tested = np.concatenate([fold.rows for fold in folds])
    assert sorted(tested) == list(range(27))
    for fold in folds:
        assert len(fold.rows) == 9
        assert fold.training.info.pushes == 18
        assert not set(fold.training.repeats()) & set(fold.tests.repeats())
        np.testing.assert_array_equal(fold.tests.repeats(), REPEATS[fold.rows])


def test_a_part_is_divided_as_the_whole_is(store):
    part = np.arange(1, 27, 2)
    whole = fold_of_push(REPEATS, 3)
    for fold in make_folds(store, 3, part):
        np.testing.assert_array_equal(fold.rows, part[whole[part] == fold.number])
        assert set(fold.training.rows) == set(part) - set(fold.rows)


def test_another_seed_draws_other_folds():
    assert (fold_of_push(REPEATS, 3, 0) != fold_of_push(REPEATS, 3, 1)).any()


def test_errors_of_all_folds_follow_the_order_of_the_store(store):
    models = [load_model("physics")]
    folds = make_folds(store, 3)
    joined = join_folds([(fold, evaluate(models, fold.tests)) for fold in folds[::-1]])
    whole = evaluate(models, store)
    np.testing.assert_allclose(
        joined.values("final_pos_mm", "physics"),
        whole.values("final_pos_mm", "physics"),
        rtol=1e-4,
    )
    for name in ("travel_mm", "condition", "row"):
        np.testing.assert_array_equal(joined.data[name], whole.data[name])
    np.testing.assert_array_equal(joined.data["fold"], fold_of_push(REPEATS, 3))
    narrow, wide = (
        to_json_object(summarise(each))["rows"][0] for each in (whole, joined)
    )
    assert narrow["final_pos_mm"] == pytest.approx(wide["final_pos_mm"], rel=1e-4)
    assert narrow["final_pos_mm_interval"] != wide["final_pos_mm_interval"]
