"""Errors and their intervals against plain loops and cases that a hand can check."""

import numpy as np
import pytest
from scipy.stats import t as student_t

from sainet.datasets.store import last_known
from sainet.evaluation.as_json import to_json_object
from sainet.evaluation.intervals import Sample
from sainet.evaluation.joining import pool_trainings
from sainet.evaluation.measurements import Condition, Header, measurements_of
from sainet.evaluation.metrics import (
    MEASURED,
    ModelErrors,
    final_errors,
    push_errors,
    travel_mm,
)
from sainet.evaluation.summary import summarise
from sainet.models.identity import ModelId

PUSHES, STEPS, BODIES = 6, 9, 2


@pytest.fixture
def poses():
    rng = np.random.default_rng(0)
    true, predicted = rng.normal(0, 2, (2, PUSHES, STEPS, BODIES, 3))
    observed = rng.random((PUSHES, STEPS)) < 0.6
    observed[:, 2] = True
    return predicted, true, observed


def turn_between(one: float, other: float) -> float:
    """The smaller angle between two directions (degrees)."""
    cosine = np.cos(one) * np.cos(other) + np.sin(one) * np.sin(other)
    return float(np.rad2deg(np.arccos(np.clip(cosine, -1, 1))))


def test_errors_are_those_of_plain_loops(poses):
    predicted, true, observed = poses
    found = push_errors(
        predicted, np.where(observed[..., None, None], true, np.nan), observed
    )
    for push in range(PUSHES):
        for body in range(BODIES):
            places, turns = [], []
            for step in range(STEPS):
                if observed[push, step]:
                    p, t = predicted[push, step, body], true[push, step, body]
                    places.append(1000 * np.hypot(p[0] - t[0], p[1] - t[1]))
                    turns.append(turn_between(p[2], t[2]))
            wanted = {
                "pos_mm": np.mean(places),
                "rot_deg": np.mean(turns),
                "final_pos_mm": places[-1],
                "final_rot_deg": turns[-1],
            }
            for metric, value in wanted.items():
                assert found[metric][push, body] == pytest.approx(value, rel=1e-6)


@pytest.mark.parametrize(
    ("shift", "name", "wanted"),
    [
        ((0.001, 0, 0), "pos_mm", 1),
        ((-0.003, 0.004, 0), "pos_mm", 5),
        ((0, 0, np.deg2rad(2)), "rot_deg", 2),
        ((0, 0, np.deg2rad(-358)), "rot_deg", 2),
        ((0, 0, np.pi), "rot_deg", 180),
        ((0, 0, 6 * np.pi), "rot_deg", 0),
    ],
)
def test_a_translation_or_rotation_is_the_error(poses, shift, name, wanted):
    _, true, observed = poses
    errors = push_errors(true + np.array(shift), true, observed)
    other = "rot_deg" if name == "pos_mm" else "pos_mm"
    for prefix in ("", "final_"):
        np.testing.assert_allclose(errors[prefix + name], wanted, atol=1e-6)
        np.testing.assert_allclose(errors[prefix + other], 0, atol=1e-6)


def test_angles_wrap_at_half_a_turn():
    predicted, true = np.zeros((2, 1, 1, 1, 3))
    predicted[..., 2], true[..., 2] = np.deg2rad(179), np.deg2rad(-181 + 360 + 2)
    errors = push_errors(predicted, true, np.ones((1, 1), bool))
    assert errors["rot_deg"][0, 0] == pytest.approx(2)
    true[..., 2] = np.deg2rad(-179)
    errors = push_errors(predicted, true, np.ones((1, 1), bool))
    assert errors["rot_deg"][0, 0] == pytest.approx(2)


def test_unobserved_pushes_have_unknown_errors(poses):
    predicted, true, observed = poses
    observed[3] = False
    errors = push_errors(predicted, np.full_like(true, np.nan), observed)
    for values in errors.values():
        assert not np.isfinite(values)[3].any()
    ends = last_known(true, observed)
    assert np.isnan(ends[3]).all()
    assert np.isfinite(np.delete(ends, 3, axis=0)).all()


def test_final_poses_are_the_last_observed_poses(poses):
    _, true, observed = poses
    for push, pose in enumerate(last_known(true, observed)):
        last = max(np.flatnonzero(observed[push]))
        np.testing.assert_array_equal(pose, true[push, last])


def test_errors_of_final_poses(poses):
    true = poses[1][:, 0]
    errors = final_errors(true + np.array([0.0, 0.002, np.deg2rad(3)]), true)
    np.testing.assert_allclose(errors["final_pos_mm"], 2)
    np.testing.assert_allclose(errors["final_rot_deg"], 3)
    assert np.isnan(errors["pos_mm"]).all()
    assert np.isnan(errors["rot_deg"]).all()


def test_travel_is_the_distance_between_the_ends():
    start = np.array([[[1.0, 2.0, 0.0]]])
    end = np.array([[[1.003, 2.004, 9.0]]])
    np.testing.assert_allclose(travel_mm(start, end), [[5.0]])


FACTORS = {"pos_mm": 1, "rot_deg": 2, "final_pos_mm": 3, "final_rot_deg": 4}


def errors_of(values):
    return {name: values * FACTORS.get(name, 5) for name in MEASURED}


def measured(errors, travel, *, group="", reference=0.25):
    """Measurements of models of one training each, ``{name: errors}``."""
    stacked = {
        name: np.stack([each[name][None] for each in errors.values()])
        for name in MEASURED
    }
    header = Header(
        models=tuple(ModelId(kind="in", name=name) for name in errors),
        conditions=(Condition(label=group),),
        reference_m=reference,
    )
    rows = np.arange(len(travel))
    return measurements_of(stacked, travel, header, condition=0 * rows, row=rows)


def rows_of(errors, travel, **settings):
    found = to_json_object(summarise(measured({"m": errors}, travel, **settings)))
    return found["rows"]


@pytest.mark.parametrize("reference", [0.25, 0.345])
def test_rows_hold_means_and_percentages(reference):
    values = np.array([[1.0, 2.0], [3.0, 6.0]])
    travel = np.array([[10.0, 5.0], [30.0, 11.0]])
    rows = rows_of(errors_of(values), travel, group="g", reference=reference)
    assert [(r["model"], r["body"], r["group"], r["n"]) for r in rows] == [
        ("m", 1, "g", 2),
        ("m", 2, "g", 2),
    ]
    for row, mean, way in zip(rows, (2.0, 4.0), (20.0, 8.0), strict=True):
        for name, factor in FACTORS.items():
            assert row[name] == pytest.approx(factor * mean)
        assert row["trans_percent"] == pytest.approx(100 * mean / (1000 * reference))
        assert row["relative_percent"] == pytest.approx(100 * 3 * mean / way)
        for name in (*MEASURED, "trans_percent", "relative_percent"):
            low, high = row[name + "_interval"]
            assert low <= row[name] <= high


def test_rows_of_one_push_have_no_interval_and_unknown_is_none():
    unknown = np.full((1, 1), np.nan)
    errors = errors_of(np.ones((1, 1))) | dict.fromkeys(("pos_mm", "rot_deg"), unknown)
    (row,) = rows_of(errors, np.ones((1, 1)))
    assert row["pos_mm"] is None
    assert row["final_pos_mm"] == 3
    assert row["final_pos_mm_interval"] == [None, None]


# Intervals.


def test_intervals_cover_the_mean_about_95_times_in_100():
    rng = np.random.default_rng(1)
    values = rng.normal(3, 2, (80, 300))  # 300 samples of 80 pushes
    mean, low, high = Sample(values).interval
    np.testing.assert_allclose(mean, values.mean(0))
    covered = ((low < 3) & (high > 3)).mean()
    assert 0.9 < covered < 0.98
    # A normal mean's interval: 1.96 standard errors to either side.
    np.testing.assert_allclose(
        (high - low).mean(), 2 * 1.96 * 2 / np.sqrt(80), rtol=0.05
    )


def test_intervals_are_the_same_every_time():
    values = np.random.default_rng(2).normal(size=(20, 3))
    for one, other in zip(
        Sample(values).interval, Sample(values).interval, strict=True
    ):
        np.testing.assert_array_equal(one, other)


def test_unknown_values_have_no_interval():
    values = np.random.default_rng(2).normal(size=(20, 3))
    whole = Sample(values).interval
    values[4, 1] = np.nan
    for one, other in zip(Sample(values).interval, whole, strict=True):
        assert np.isnan(one[1])
        np.testing.assert_array_equal(one[[0, 2]], other[[0, 2]])


def test_a_ratio_is_that_of_the_means_of_the_same_pushes():
    rng = np.random.default_rng(3)
    below = rng.uniform(1, 9, (60, 1))
    found = Sample(0.3 * below).over(Sample(below))
    np.testing.assert_allclose(found, 0.3)  # pairs stay together, so it never varies
    ratio, low, high = Sample(rng.uniform(1, 2, (60, 1))).over(Sample(below))
    assert low < ratio < high


def test_differences_are_paired():
    rng = np.random.default_rng(4)
    hard = rng.uniform(0, 100, (40, 1))  # some pushes are hard for every model
    better = hard - 1 + rng.normal(0, 0.1, hard.shape)
    difference, low, high = Sample(better).minus(Sample(hard))
    assert difference[0] == pytest.approx(-1, abs=0.1)
    assert -1.2 < low[0] < high[0] < -0.8


def test_trainings_count_as_in_the_t_interval():
    rng = np.random.default_rng(6)
    pushes = rng.normal(3, 1, (1, 200, 1))
    luck = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])[:, None, None]
    mean, low, high = Sample(pushes + luck).interval
    _, low_one, high_one = Sample(pushes).interval
    assert mean == pytest.approx(pushes.mean())
    # The t interval of 5 (SciPy's), hardly widened by 1 over the root of 200 pushes.
    _, wanted = student_t.interval(0.95, 4, 0, 0.7906 / np.sqrt(5))
    assert high[0] - low[0] == pytest.approx(2 * wanted, rel=0.1)
    assert high[0] - low[0] > 3 * (high_one[0] - low_one[0])
    # Trainings of two models are drawn apart: alike luck is no pair.
    _, low, high = Sample(pushes + luck).minus(Sample(pushes + luck + 0.1))
    assert low[0] < -0.5 < 0.3 < high[0]


@pytest.mark.parametrize("trainings", [3, 5])
def test_intervals_of_few_trainings_cover_about_95_times_in_100(trainings):
    rng = np.random.default_rng(8)
    held = [[], []]
    for _ in range(400):
        luck = rng.normal(0, 1, (2, trainings, 1, 1))
        one, other = luck + rng.normal(0, 1, (1, 40, 1))
        for which, (_, low, high) in enumerate(
            (Sample(one).interval, Sample(one).minus(Sample(other)))
        ):
            held[which].append(bool(low[0] <= 0 <= high[0]))
    of_mean, of_difference = map(np.mean, held)
    assert 0.92 < of_mean < 0.98
    assert of_difference > 0.93  # of few trainings, a little wide


def test_pooled_trainings_are_one_model():
    rng = np.random.default_rng(7)
    parts = {f"m-{n}": errors_of(rng.uniform(size=(10, 2))) for n in range(3)}
    runs = measured(parts, np.ones((10, 2)))
    whole = pool_trainings(runs, {ModelId(kind="in", name="m"): list(parts)})
    for body, row in enumerate(to_json_object(summarise(whole))["rows"]):
        mean = np.mean([part["pos_mm"][:, body].mean() for part in parts.values()])
        assert (row["trainings"], row["pos_mm"]) == (3, pytest.approx(mean))


def test_a_model_does_not_differ_from_itself():
    errors = errors_of(np.random.default_rng(5).uniform(size=(10, 2)))
    found = summarise(measured({"b": errors, "a": errors}, np.ones((10, 2))))
    rows = to_json_object(found)["comparisons"]
    assert len(rows) == 2 * len(MEASURED)
    for row in rows:
        assert (row["difference"], row["interval"]) == (0, [0, 0])
        assert (row["model"], row["against"]) == ("a", "b")


def test_errors_over_the_travel_of_a_resting_body_are_unknown():
    travel = np.full((12, 3), 10.0)  # mm
    travel[:, 1] = 0.0
    travel[1:, 2] = 0.0  # moves in one push, which some resamples lack
    known = ModelErrors({"final_pos_mm": np.full((12, 3), 2.0)}, travel, 0.25)
    value, low, high = known.per_travel("final_pos_mm")
    np.testing.assert_allclose(value, [20, np.nan, 240])
    np.testing.assert_allclose(low, [20, np.nan, np.nan])
    np.testing.assert_allclose(high, [20, np.nan, np.nan])
