"""Whole evaluations of small stores."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from msgspec import structs

from learning.stores import end_points_alone, info_of, made_up, quiet_store, write
from models.samples import CARD as SAMPLE
from models.samples import quick_dynamics
from sainet.datasets.batch import Prediction, to_batch
from sainet.engines import make_engine, simulator
from sainet.engines.base import AssumedProperties
from sainet.engines.simulator import (
    TRUE_PROPERTIES,
    Assumptions,
    InternalEngine,
    PlanarSpec,
    stored_simulator,
)
from sainet.evaluation.as_json import to_json_object
from sainet.evaluation.evaluate import evaluate
from sainet.evaluation.joining import pool_trainings
from sainet.evaluation.summary import summarise
from sainet.models.dynamics import AbstractDynamics, PhysicsDynamics, predict
from sainet.models.identity import ModelId
from sainet.models.library import load_model
from sainet.models.model import Model
from sainet.runs.digests import digests_to_text
from sainet.runs.errors import BadCheckpoint, BadInput, Diverged, UnknownName
from sainet.scenes.recording import CameraOffset
from sainet.scenes.state import State, Trajectory

PUSHES = 11
LENGTHS = np.array([12, 5, 12, 8, 5, 12, 8, 8, 12, 5, 12])


class Rest(AbstractDynamics):
    """Predicts that nothing moves, but for a shift (m) along x."""

    shift: jax.Array

    def begin(self, scene, state):
        return state

    def advance(self, scene, carry, controls, simulated=None):
        def repeat(x):
            return jnp.repeat(x[:, None], controls.steps, axis=1)

        states: State = jax.tree.map(repeat, carry)
        place = states.position.at[..., 0].add(self.shift)
        states = eqx.tree_at(lambda s: s.position, states, place)
        return carry, Trajectory(states)


def resting(name="rest", shift=0.0, card=None):
    return Model(ModelId(kind="in", name=name), Rest(jnp.float32(shift)), card)


@pytest.fixture(scope="session")
def simulated(tmp_path_factory):
    """Made-up pushes of three lengths in two groups."""
    info = info_of(PUSHES, groups=("rough", "even"))
    arrays = made_up(info, LENGTHS)
    arrays["group"] = np.arange(PUSHES) % 2
    return write(tmp_path_factory.mktemp("simulated"), info, arrays)


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """Pushes of which the ends are known, beside a published model's prediction."""
    info = info_of(
        PUSHES, bodies=1, engine="recorded", seed=None, published=("convex",)
    )
    arrays = made_up(info, LENGTHS)
    last = arrays["truth"][np.arange(PUSHES), LENGTHS - 1, :, :3]
    arrays["published_convex"] = last + np.array([0.0, 0.002, np.deg2rad(3)])
    arrays = end_points_alone(arrays)
    return write(tmp_path_factory.mktemp("recorded"), info, arrays)


def errors_at_rest(store, limit, shift=0.0):
    """What `Rest` gets wrong, push by push in the order of the store."""
    arrays = store.read(slice(None))
    means, finals, ways = [], [], []
    for push in range(store.info.pushes):
        steps = min(LENGTHS[push], limit)
        start = arrays["initial"][push, :, :2].astype(float)
        true = arrays["truth"][push, :steps, :, :2].astype(float)
        gap = 1000 * np.linalg.norm(start + [shift, 0] - true, axis=-1)
        means.append(gap.mean(0))
        finals.append(gap[-1])
        ways.append(1000 * np.linalg.norm(true[-1] - start, axis=-1))
    return np.array(means), np.array(finals), np.array(ways)


@pytest.mark.parametrize(("steps", "limit"), [(None, 12), (0, 12), (12, 12), (6, 6)])
def test_pushes_of_mixed_length_keep_the_order_of_the_store(simulated, steps, limit):
    told = []
    found = evaluate(
        [resting(shift=0.001)],
        simulated,
        steps=steps,
        on_pushes=lambda *a: told.append(a),
    )
    mean, final, way = errors_at_rest(simulated, limit, 0.001)
    np.testing.assert_allclose(found.values("pos_mm", "rest"), mean, rtol=1e-3)
    np.testing.assert_allclose(found.values("final_pos_mm", "rest"), final, rtol=1e-3)
    np.testing.assert_allclose(found.data["travel_mm"].values, way, rtol=1e-3)
    assert sum(pushes for _, pushes in told) == PUSHES


def test_pushes_of_many_lengths_share_two_programs(tmp_path):
    """Each would take seconds to compile; what follows the end of a push is unseen."""
    info = info_of(9)
    arrays = made_up(info, lengths=[5, 6, 7, 8, 9, 10, 11, 12, 12])
    store = write(tmp_path / "data", info, arrays)
    read = []

    class Noting(PhysicsDynamics):
        def advance(self, scene, carry, controls, simulated=None):
            read.append(controls.steps)
            return super().advance(scene, carry, controls, simulated)

    dynamics = Noting(make_engine("planar"))
    model = Model(ModelId(kind="physics", name="engine"), dynamics)
    found = evaluate([model], store).values("final_pos_mm", "engine")
    assert set(read) == {6, 12}
    for push in range(9):
        alone = evaluate([model], store.take([push])).values("final_pos_mm", "engine")
        np.testing.assert_allclose(found[..., push, :], alone[..., 0, :], rtol=1e-4)


def test_groups_have_separate_means(simulated):
    found = evaluate([resting()], simulated)
    mean, _, _ = errors_at_rest(simulated, 12)
    rows = to_json_object(summarise(found))["rows"]
    assert [(r["group"], r["body"]) for r in rows] == [
        ("even", 1),
        ("even", 2),
        ("rough", 1),
        ("rough", 2),
    ]
    for row in rows:
        part = mean[("rough", "even").index(row["group"]) :: 2, row["body"] - 1]
        assert (row["n"], row["pos_mm"]) == (
            len(part),
            pytest.approx(part.mean(), rel=1e-3),
        )
        assert row["trans_percent"] == pytest.approx(row["pos_mm"] / 2.5)


def test_models_are_compared_pair_by_pair(simulated):
    models = [resting(), resting("same"), resting("shifted", 0.02)]
    rows = to_json_object(summarise(evaluate(models, simulated)))["comparisons"]
    pairs = [("same", "rest"), ("shifted", "rest"), ("shifted", "same")]
    found = dict.fromkeys((row["model"], row["against"]) for row in rows)
    assert list(found) == pairs
    for row in rows:
        if row["model"] == "same":
            assert (row["difference"], row["interval"]) == (0, [0, 0])
        elif row["metric"] == "pos_mm":
            assert row["difference"] > 5
            assert row["interval"][0] > 0


def test_recorded_pushes_have_final_errors_beside_published_ones(recorded):
    found = evaluate([resting()], recorded)
    (row,) = to_json_object(summarise(found))["rows"]
    _, final, _ = errors_at_rest(recorded, 12)
    assert row["final_pos_mm"] == pytest.approx(final.mean(), rel=1e-3)
    assert row["group"] is None
    assert row["trans_percent"] == pytest.approx(row["pos_mm"] / 3.45)
    (published,) = to_json_object(summarise(found))["published"]
    assert published["model"] == "convex"
    assert published["final_pos_mm"] == pytest.approx(2, rel=1e-3)
    assert published["final_rot_deg"] == pytest.approx(3, rel=1e-3)
    assert published["pos_mm"] is None
    assert not [name for name in published if name.endswith("_interval")]


def test_unobserved_errors_are_nan_not_zero(recorded):
    found = evaluate([resting()], recorded, steps=8)
    known = np.isfinite(found.values("final_pos_mm", "rest")[:, 0])
    np.testing.assert_array_equal(known, LENGTHS <= 8)


def test_the_true_engine_has_no_error(tmp_path_factory):
    store = quiet_store(tmp_path_factory.getbasetemp())
    exact = AssumedProperties(make_engine("planar"), Assumptions())
    truth = ModelId(kind="physics", name="truth")
    models = [Model(truth, PhysicsDynamics(exact)), load_model("physics")]
    found = evaluate(models, store)
    for name, tolerance in (("pos_mm", 1e-3), ("rot_deg", 1e-3)):
        assert found.values(name, "truth").max() < tolerance
        assert found.values(name, "physics").mean() > 100 * tolerance


CARD = structs.replace(SAMPLE, data_seeds=(17,))


def test_networks_are_refused_on_other_pushes_unless_forced(simulated):
    card = structs.replace(CARD, kind="direct-force")
    with pytest.raises(BadCheckpoint, match="kind is 'direct-force'"):
        evaluate([resting(card=card)], simulated)
    evaluate([resting(card=card)], simulated, force=True)


def test_recorded_training_pushes_are_refused_as_test_pushes(recorded):
    seen = digests_to_text(recorded.first(3).push_hashes())
    card = structs.replace(CARD, pushes=seen)
    with pytest.raises(BadCheckpoint, match=rf"trained on 3 of these {PUSHES}.*split"):
        evaluate([resting(card=card)], recorded)
    evaluate([resting(card=card)], recorded.take(range(3, PUSHES)))
    evaluate([resting(card=card)], recorded, force=True)


def test_predictions_of_a_network_are_those_of_its_rollout(simulated):
    model = Model(ModelId(kind="in"), quick_dynamics("in", "robot"))
    rows = to_json_object(summarise(evaluate([model], simulated, steps=5)))["rows"]
    arrays = simulated.read(slice(None))
    batch = to_batch(arrays, simulated.info, steps=5)
    rolled = predict(model.dynamics, batch.scene, batch.initial, batch.controls)
    far = np.linalg.norm(
        rolled.states.position - arrays["truth"][:, :5, :, :2], axis=-1
    )
    for row in rows:
        group = simulated.info.groups.index(row["group"])
        wanted = 1000 * far[arrays["group"] == group, :, row["body"] - 1].mean()
        assert row["pos_mm"] == pytest.approx(wanted, rel=1e-3)


def test_a_prediction_that_is_not_finite_is_named(simulated):
    named = r"^lost: .* push 0 .*simulated.* not finite, nor are 10 more of 11"
    with pytest.raises(Diverged, match=named):
        evaluate([resting("lost", np.nan)], simulated)


def test_trainings_are_pooled_into_one_model(simulated):
    shifts = {"a-0": 0.001, "a-1": 0.003}
    models = [resting(name, shift) for name, shift in shifts.items()]
    found = evaluate([resting(), *models, resting("z", 0.002)], simulated)
    found = pool_trainings(found, {ModelId(kind="in", name="a"): list(shifts)})
    rows = to_json_object(summarise(found))["rows"]
    assert list(dict.fromkeys(row["model"] for row in rows)) == ["rest", "a", "z"]
    mean, _, _ = np.mean(
        [errors_at_rest(simulated, 12, shift) for shift in shifts.values()], axis=0
    )
    for row in (row for row in rows if row["model"] == "a"):
        part = mean[("rough", "even").index(row["group"]) :: 2, row["body"] - 1]
        assert row["pos_mm"] == pytest.approx(part.mean(), rel=1e-3)
        assert (row["trainings"], row["n"]) == (2, len(part))


def test_two_models_of_one_name_are_refused(simulated):
    with pytest.raises(BadInput, match="rest, rest are not all different"):
        evaluate([resting(), resting()], simulated)


@pytest.mark.parametrize(
    ("steps", "message"),
    [(-1, "`steps` is -1; it must be at least 0"), (13, "`steps` is 13; .* has 12")],
)
def test_steps_that_the_pushes_do_not_have_are_refused(simulated, steps, message):
    with pytest.raises(BadInput, match=message):
        evaluate([resting()], simulated, steps=steps)


def test_stored_predictions_replace_the_engine(simulated):
    """The store's predictions are made up: no engine makes such ones."""
    found = evaluate([load_model("physics")], simulated)
    arrays = simulated.read(slice(None))
    far = np.linalg.norm(
        (arrays["simulated_planar"] - arrays["truth"])[..., :2].astype(float), axis=-1
    )
    wanted = [1000 * far[push, :steps].mean(0) for push, steps in enumerate(LENGTHS)]
    np.testing.assert_allclose(
        found.values("pos_mm", "physics").reshape(PUSHES, 2), wanted, rtol=1e-4
    )


@pytest.mark.parametrize(
    "internal",
    [
        InternalEngine(PlanarSpec(version=2)),
        InternalEngine(PlanarSpec(pressure_radius_ratio=0.5)),
        InternalEngine(PlanarSpec(assumptions=TRUE_PROPERTIES)),
        InternalEngine(PlanarSpec(), CameraOffset(x=1e-3)),
    ],
)
def test_other_predictions_are_not_taken_from_the_store(simulated, internal):
    assert Prediction(InternalEngine(PlanarSpec()), simulated.info).is_stored
    assert not Prediction(internal, simulated.info).is_stored


def test_a_later_engine_has_another_name_in_datasets(simulated, monkeypatch):
    later = PlanarSpec(version=2)
    monkeypatch.setattr(simulator, "SIMULATORS", {"planar": later})
    assert later.slug == "planar"
    assert not Prediction(InternalEngine(later), simulated.info).is_stored
    with pytest.raises(UnknownName, match="No simulator named 'planar'"):
        stored_simulator("planar")


def test_simulated_training_pushes_are_refused_as_test_pushes(simulated):
    seen = digests_to_text(simulated.first(3).push_hashes())
    card = structs.replace(CARD, pushes=seen, data_seeds=())
    with pytest.raises(BadCheckpoint, match=rf"trained on 3 of these {PUSHES}"):
        evaluate([resting(card=card)], simulated)
    evaluate([resting(card=card)], simulated.take(range(3, PUSHES)))
