"""Gaussian processes around an engine: predictions, regions, files and refusals."""

import json
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from msgspec import structs
from scipy.stats import multivariate_normal
from tinygp import kernels, transforms
from tinygp.kernels.distance import L2Distance

import sainet as sn
from learning.stores import info_of, made_up
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.datasets.splits import fold_of_push
from sainet.datasets.store import open_store
from sainet.datasets.writer import write_store
from sainet.engines.simulator import SIMULATORS, InternalEngine
from sainet.evaluation.coverage import coverage_of, measured
from sainet.evaluation.evaluate import evaluate
from sainet.evaluation.unlike import other_numbers
from sainet.learning import process as process_module
from sainet.learning.process import (
    _NEAR,
    calibrated_fit,
    check_store,
    fit_process,
    fits_of,
    quantile,
    share_of,
)
from sainet.learning.process_ends import Ends, ends_of
from sainet.learning.process_fit import fit_to, loss_and_slope
from sainet.models.correctors import CONFIDENCE, Region, interval_score
from sainet.models.correctors.kernels import KERNELS
from sainet.models.correctors.process import correlation, error_near
from sainet.models.fitted_process import Fitted, corrector_of, rates_at
from sainet.models.library import load_model
from sainet.models.process_card import ARRAYS, PROCESS, ProcessSettings
from sainet.runs.digests import digests_to_text
from sainet.runs.errors import BadCheckpoint, BadInput, BadStore, RunConflict
from sainet.scenes.controls import PathControls
from sainet.scenes.geometry import rotate
from sainet.scenes.recording import CameraOffset
from sainet.scenes.state import pack_motion
from sainet.studies.run_report import page_of
from sainet.tasks.push_to_goal import PushToGoal

PUSHES = GenerateConfig(
    pushes=60, stroke_mm=(3.0,), hold_steps=30, noise_level="none", seed=9
)
PLANAR = InternalEngine(SIMULATORS["planar"])
QUICK = ProcessSettings(features="angle", iterations=20, folds=3)
TRAINED = 45


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return generate(PUSHES, tmp_path_factory.mktemp("process") / "pushes")


@pytest.fixture(scope="module")
def folder(store, tmp_path_factory):
    """A process of the first pushes, around the engine with assumed properties."""
    out = tmp_path_factory.mktemp("fitted") / "gp"
    fit_process(store.first(TRAINED), out, PLANAR, QUICK)
    return out


@pytest.fixture(scope="module")
def model(folder):
    return load_model(str(folder))


@pytest.fixture(scope="module")
def tests(store):
    return store.take(range(TRAINED, PUSHES.pushes))


def pushes_of(store):
    batch = sn.open_pushes(store.path).batch()
    take = lambda x: x[TRAINED:]  # noqa: E731
    return jax.tree.map(take, (batch.scene, batch.initial, batch.controls))


def naive_posterior(fitted, output, at):
    """Mean and variance of one output by the textbook, element by element."""

    def covariance(x, y):
        r = np.sqrt(3) * np.linalg.norm((x - y) / fitted.length[output])
        return fitted.amplitude[output] ** 2 * (1 + r) * np.exp(-r)

    points = fitted.inputs
    k = np.array([[covariance(x, y) for y in points] for x in points])
    k += fitted.noise[output] * np.eye(len(points))
    across = np.array([covariance(at, x) for x in points])
    mean = across @ np.linalg.solve(k, fitted.outputs[output])
    left = covariance(at, at) - across @ np.linalg.solve(k, across)
    return mean, left + fitted.noise[output]


def test_mean_and_deviation_are_those_of_the_textbook():
    rng = np.random.default_rng(0)
    fitted = Fitted(
        inputs=rng.normal(size=(12, 2)),
        outputs=rng.normal(size=(3, 12)),
        amplitude=np.array([1.0, 0.5, 2.0]),
        length=rng.uniform(0.5, 2, (3, 2)),
        noise=np.array([0.1, 0.2, 0.3]),
        mean=np.array([0.1, 0.2, 0.3]),
        scale=np.array([1.0, 2.0, 3.0]),
        share=np.array([0.25, 1.0, 0.0]),
        centre=np.array([0.5, -0.5]),
        width=np.array([2.0, 3.0]),
        errors=np.ones((12, 1, 2)),
        near=np.ones((1, 2, 2)),
        reach=np.ones((1, 2)),
        plain=np.ones((1, 2)),
    )
    process = corrector_of(fitted, ("contact_angle", "place_x"), 1 / 240)
    raw = rng.normal(size=(5, 2))
    single = process.rates(jnp.asarray(raw, jnp.float32))
    for (mean, deviation), error in ((single, 1e-4), (rates_at(fitted, raw), 1e-12)):
        for push, at in enumerate((raw - fitted.centre) / fitted.width):
            for output in range(3):
                known = naive_posterior(fitted, output, at)
                expected = fitted.mean[output] + fitted.scale[output] * known[0]
                expected *= fitted.share[output]
                np.testing.assert_allclose(mean[push, output], expected, atol=error)
                wide = fitted.scale[output] * np.sqrt(known[1])
                np.testing.assert_allclose(deviation[push, output], wide, rtol=error)


def test_a_process_errs_less_than_the_engine_that_it_corrects(model, tests):
    found = evaluate([load_model("physics"), model], tests)
    error = found.data["final_pos_mm"].values[:, 0].mean(axis=0)  # [push, body]
    physics, process = found.data["final_pos_mm"].values[:, 0].mean(axis=1)
    assert (process < 0.8 * physics).all(), error


def test_equal_settings_make_equal_bytes(store, folder, tmp_path):
    fit_process(store.first(TRAINED), tmp_path / "gp", PLANAR, QUICK)
    for name in (PROCESS, ARRAYS):
        assert (tmp_path / "gp" / name).read_bytes() == (folder / name).read_bytes()


def test_a_finished_process_is_not_fitted_again(store, folder):
    def fail():
        pytest.fail("fitted again")

    fit_process(store.first(TRAINED), folder, PLANAR, QUICK, on_output=fail)


def test_two_advances_equal_a_long_advance(model, store):
    scene, initial, controls = pushes_of(store)
    dynamics, halves = model.dynamics, []
    carry = dynamics.begin(scene, initial)
    whole = dynamics.advance(scene, carry, controls)[1]
    for part in (slice(0, 9), slice(9, None)):
        some = PathControls(controls.position[:, part], controls.velocity[:, part])
        carry, trajectory = dynamics.advance(scene, carry, some)
        halves.append(np.asarray(pack_motion(trajectory.states)))
    # Rates are per metre: the heading of nine steps is that of all but for rounding.
    whole, parts = pack_motion(whole.states), np.concatenate(halves, axis=1)
    np.testing.assert_allclose(parts[..., :3], whole[..., :3], atol=2e-5)


def test_velocities_fit_poses(model, store):
    scene, initial, controls = pushes_of(store)
    states = model.predict(scene, initial, controls).states
    position = np.asarray(states.position, np.float64)
    step = np.diff(position, axis=1) / scene.time_step
    np.testing.assert_allclose(step, states.velocity[:, 1:], atol=2e-4)


def test_nothing_is_added_while_the_pusher_is_at_rest(model, store):
    scene, initial, controls = pushes_of(store)
    path = jnp.broadcast_to(initial.pusher_position[:, None], controls.position.shape)
    still = PathControls(path, jnp.zeros_like(path))
    physics = load_model("physics").predict(scene, initial, still)
    found = model.predict(scene, initial, still)
    for part in ("position", "angle"):
        known = getattr(physics.states, part)
        np.testing.assert_allclose(getattr(found.states, part), known, atol=1e-7)


def test_a_turned_table_turns_the_prediction(model, store):
    scene, initial, controls = pushes_of(store)
    angle = 1.1

    def turn(vector):
        return rotate(vector, jnp.full(vector.shape[:-1], angle))

    turned = eqx.tree_at(
        lambda s: (s.position, s.angle, s.pusher_position),
        initial,
        (
            turn(initial.position),
            initial.angle + angle,
            turn(initial.pusher_position),
        ),
    )
    whole = PathControls(turn(controls.position), turn(controls.velocity))
    plain = model.predict(scene, initial, controls).final
    found = model.predict(scene, turned, whole).final
    np.testing.assert_allclose(found.position, turn(plain.position), atol=3e-6)
    np.testing.assert_allclose(found.angle, plain.angle + angle, atol=3e-5)


def test_regions_hold_about_as_many_ends_as_they_promise(model, tests):
    found = coverage_of(evaluate([model], tests))
    assert {(each.body, each.kind) for each in found} == {
        *((1, "pos"), (1, "rot"), (2, "pos"), (2, "rot"))
    }
    for each in found:
        assert 60 <= each.inside.value <= 100  # %, of 15 pushes
        assert 0 < each.size.value <= each.score.value


def test_the_quantile_holds_its_level_for_exchangeable_scores():
    rng = np.random.default_rng(0)
    held = []
    for _ in range(400):
        scores = rng.exponential(size=(51, 1, 2))
        held.append(scores[-1] <= quantile(scores[:-1]))
    assert abs(np.mean(held) - CONFIDENCE) < 0.03
    assert (quantile(np.arange(5.0)[:, None, None] + np.zeros((1, 1, 2))) == 4).all()


def test_the_share_has_the_smallest_squared_errors():
    rng = np.random.default_rng(0)
    rates = rng.normal(size=(40, 6))
    predicted = rng.uniform(-0.3, 2.0, 6) * rates + rng.normal(size=(40, 6))
    shares = np.linspace(0, 1, 2001)
    off = rates - shares[:, None, None] * predicted
    squares = np.sum(off**2, axis=1)
    for which in ([0, 1], [2], [3, 4], [5]):
        best = shares[np.argmin(squares[:, which].sum(axis=1))]
        np.testing.assert_allclose(share_of(predicted, rates)[which], best, atol=3e-4)
    assert (share_of(-rates, rates) == 0).all()
    assert (share_of(0 * rates, rates) == 0).all()
    assert (share_of(rates / 2, rates) == 1).all()


def test_little_is_added_where_there_is_nothing_to_learn():
    rng, settings = np.random.default_rng(0), ProcessSettings(iterations=10)
    shares = []
    for seed in range(8):
        ends = scattered(25, seed, loud=1.0)
        rates = 0.02 * rng.normal(size=ends.rates.shape)
        pure = replace(ends, rates=rates)
        shares.append(calibrated_fit(pure, settings).fitted.share)
        known = calibrated_fit(scattered(200, seed, 1.0), settings)
        assert (known.fitted.share > 0.9).all()
    assert np.mean(shares) < 0.25


def scattered(pushes: int, seed: int, loud: float) -> Ends:
    """Ends that scatter `loud` times as much where the first input is positive."""
    rng = np.random.default_rng(seed)
    inputs = rng.uniform(-1, 1, (pushes, 2))
    size = np.where(inputs[:, :1] > 0, loud, 1.0)
    rates = 0.1 * np.sin(3 * inputs).sum(axis=1, keepdims=True)
    rates = rates + 0.02 * size * rng.normal(size=(pushes, 3))
    names = ("contact_angle", "place_x")
    return Ends(names, inputs, rates, np.ones(pushes), np.arange(pushes))


def test_a_calibration_is_that_of_a_loop():
    """Of pushes that were executed twice, and two disks; folds keep both together."""
    settings = ProcessSettings(iterations=3, folds=3, seed=5)
    ends, other = scattered(40, 10, loud=4.0), scattered(40, 11, loud=4.0)
    rates = np.concatenate([ends.rates, 2 * other.rates], axis=1)
    noise = rates[:, [1, 4]] - rates[:, [0, 3]]  # y follows another law than x
    rates[:, [1, 4]] = 0.1 * np.sin(9 * ends.inputs[:, :1]) + 0.3 * noise
    ends = replace(ends, rates=rates, kinds=np.arange(40) // 2)
    fitted = calibrated_fit(ends, settings).fitted
    whole, _ = fit_to(ends, settings)
    begin = np.log(np.c_[whole.amplitude, np.sqrt(whole.noise), whole.length])
    owner, mean, deviation = fold_of_push(ends.kinds, 3, 5), 0 * rates, 0 * rates
    assert (owner[::2] == owner[1::2]).all()
    for fold in range(3):
        part, _ = fit_to(ends.take(owner != fold), settings, begin=begin)
        held = owner == fold
        mean[held], deviation[held] = rates_at(part, ends.inputs[held])
    np.testing.assert_allclose(fitted.share, share_of(mean, rates))
    off = rates - fitted.share * mean
    for body, kind in np.ndindex(2, 2):
        columns = slice(3 * body, 3 * body + 2) if kind == 0 else [3 * body + 2]
        missed = np.linalg.norm(off[:, columns], axis=1)
        found = np.linalg.norm((off / deviation)[:, columns], axis=1)
        np.testing.assert_allclose(fitted.errors[:, body, kind], found)
        assert fitted.plain[body, kind] == pytest.approx(np.sort(missed)[36])  # of 40
        # Of two numbers their geometric mean: that of a circle of equal area.
        size = np.exp(np.log(deviation[:, columns]).mean(axis=1))
        length = np.exp(np.log(whole.length[columns]).mean(axis=0))
        score, reach, near = min(
            score_of(whole.inputs, found, size, owner, width * length)
            for width in _NEAR
        )
        assert fitted.reach[body, kind] == pytest.approx(reach)
        np.testing.assert_allclose(fitted.near[body, kind], near)


def score_of(inputs, errors, size, owner, length):
    """The mean interval score of neighbourhoods, its factor, and the length scales."""
    expected = np.empty_like(errors)
    for push, at in enumerate(inputs):
        others = owner != owner[push]
        far = np.sqrt(3) * np.linalg.norm((inputs[others] - at) / length, axis=1)
        close = (1 + far) * np.exp(-far)
        known = close @ errors[others] + errors.mean()
        expected[push] = known / (close.sum() + 1)
    factor = np.sort(errors / expected)[36]
    width = factor * expected * size
    score = np.mean(width + 10 * np.maximum(errors * size - width, 0))
    return score, factor, tuple(length)


def test_repeated_pushes_count_once_for_the_calibration(store, monkeypatch):
    some = store.take([0, 0, 1, 1, 2, 2])
    check_store(some, structs.replace(QUICK, folds=3))
    with pytest.raises(BadStore, match="3 pushes that are not repeats .* at least 4"):
        check_store(some, structs.replace(QUICK, folds=4))
    monkeypatch.setattr(process_module, "MOST", 5)
    with pytest.raises(BadStore, match="6 pushes; .* takes at most 5"):
        check_store(some, structs.replace(QUICK, folds=3))


def test_the_card_records_the_pushes_the_camera_and_the_groups(tmp_path):
    info = info_of(14, groups=("wood", "abs"), engine="recorded", seed=None)
    arrays = made_up(info) | {"group": np.arange(14) % 2}
    arrays["initial_pusher"][:, 1] += np.linspace(-0.02, 0.02, 14)
    arrays["pose_observed"][-2:] = False
    write_store(tmp_path / "data", info, arrays)
    store, camera = open_store(tmp_path / "data"), CameraOffset(x=1e-3)
    engine = structs.replace(PLANAR, camera=camera)
    settings = ProcessSettings(features="angle", iterations=2, folds=2)
    fit_process(store, tmp_path / "gp", engine, settings)
    card = load_model(str(tmp_path / "gp")).card
    assert (card.trained_pushes, card.camera) == (12, camera)
    assert (card.truth_engine, card.data) == ("recorded", store.content)
    assert set(card.groups) == {"wood", "abs"}
    with pytest.raises(RunConflict, match="data is"):
        fit_process(store.first(13), tmp_path / "gp", engine, settings)


def test_regions_are_larger_where_errors_were():
    """A loop over the pushes gives the same sizes."""
    ends, others = scattered(120, 0, loud=5.0), scattered(400, 1, loud=5.0)
    fitted = calibrated_fit(ends, ProcessSettings(iterations=10)).fitted
    process = corrector_of(fitted, ends.names, 1 / 240)
    expected = np.asarray(process.expected(jnp.asarray(others.inputs, jnp.float32)))
    is_loud = others.inputs[:, 0] > 0.2
    for kind in range(2):
        loud, quiet = expected[is_loud, 0, kind], expected[~is_loud, 0, kind]
        assert np.median(loud) > 2 * np.median(quiet)
    mean, deviation = rates_at(fitted, others.inputs)
    width = fitted.reach[0, 1] * expected[:, 0, 1] * deviation[:, 2]
    error = np.abs(others.rates - mean)[:, 2]
    assert 0.84 < np.mean(error <= width) < 0.96
    plain = np.full_like(error, fitted.plain[0, 1])
    assert (
        interval_score(width, error).mean() < 0.9 * interval_score(plain, error).mean()
    )
    points = (others.inputs - fitted.centre) / fitted.width
    for push in range(5):
        for kind in range(2):
            length = fitted.near[0, kind]
            far = np.linalg.norm((fitted.inputs - points[push]) / length, axis=1)
            close = (1 + np.sqrt(3) * far) * np.exp(-np.sqrt(3) * far)
            errors = fitted.errors[:, 0, kind]
            known = (close @ errors + errors.mean()) / (close.sum() + 1)
            np.testing.assert_allclose(expected[push, 0, kind], known, rtol=2e-4)


def test_regions_are_alike_where_errors_are():
    """Some fits to pushes that scatter alike have neighbourhoods of all pushes."""
    settings, widest = ProcessSettings(iterations=10), 0
    for seed in range(6):
        ends = scattered(30, seed, loud=1.0)
        fitted = calibrated_fit(ends, settings).fitted
        assert np.isfinite(fitted.near).all()  # else the file could not be read
        process = corrector_of(fitted, ends.names, 1 / 240)
        expected = process.expected(jnp.asarray(ends.inputs, jnp.float32))
        for kind in range(2):
            if (fitted.near[0, kind] > 1e4).all():
                mean = fitted.errors[:, 0, kind].mean()
                np.testing.assert_allclose(expected[:, 0, kind], mean, rtol=1e-4)
                widest += 1
    assert widest > 0


def test_residuals_of_zero_have_regions_of_no_size():
    ends = scattered(30, 0, loud=1.0)
    exact = replace(ends, rates=0 * ends.rates)
    fit = calibrated_fit(exact, ProcessSettings(iterations=4))
    fitted = fit.fitted
    assert fit.missed == 0
    assert (fitted.reach == 0).all()
    assert np.isfinite(fitted.near).all()


def test_where_no_push_is_near_the_mean_error_is_expected():
    errors = np.array([1.0, 2.0, 6.0])
    assert error_near(errors, np.zeros((3, 1))) == 3.0
    assert error_near(errors, np.ones((3, 1))) == 3.0
    assert error_near(errors, np.array([[1.0], [0.0], [0.0]])) == 2.0


def test_interval_scores_are_those_of_the_definition():
    """Along a push to the left, an end 3 mm ahead and 1 mm aside."""
    region = Region(
        heading=jnp.array([np.pi / 2]),
        axes=jnp.array([[[2e-3, 0.5e-3]]]),
        turn=jnp.array([[0.1]]),
        plain=jnp.array([[4e-3, 0.3]]),
    )
    true = np.array([[[-1e-3, 3e-3, 2 * np.pi + 0.25]]])
    found = measured(region, np.zeros((1, 1, 3)), true)
    radius, scaled = 1.0, np.hypot(1.5, 2.0)  # mm; distance in half axes
    expected = radius + 10 * (scaled - 1) * radius
    np.testing.assert_allclose(found["score_pos"], expected, rtol=1e-5)
    np.testing.assert_allclose(found["plain_score_pos"], 4.0, rtol=1e-5)
    width, error = np.rad2deg([0.1, 0.25])
    turned = width + 10 * (error - width)
    np.testing.assert_allclose(found["score_rot"], turned, rtol=1e-5)
    assert found["inside_pos"] == 0
    assert found["inside_rot"] == 0
    # Of an end that was not observed, nothing is known.
    unseen = measured(region, np.zeros((1, 1, 3)), np.full_like(true, np.nan))
    assert np.isnan([unseen["inside_pos"], unseen["inside_rot"]]).all()
    exact = measured(region, true, true)
    assert exact["inside_pos"] == exact["inside_rot"] == 1


@pytest.mark.parametrize("disks", [1, 3])
def test_other_numbers_of_disks_are_refused(model, disks):
    scene = sn.Scene.disks(mass=[1.0] * disks, radius=[0.055] * disks)
    with pytest.raises(BadCheckpoint, match=f"takes 2 disk.s., not {disks};"):
        model.predict(scene, scene.in_a_row(), sn.Push(contact_angle=0.1))
    assert list(other_numbers([model], disks)) == []  # no second line


def test_no_network_starts_from_a_process(folder, store):
    with pytest.raises(BadCheckpoint, match="card.json: not found: this is no network"):
        sn.tune("sain", store, start=folder, iterations=1)


def test_pushes_that_it_was_fitted_to_are_refused(model, store):
    with pytest.raises(BadCheckpoint, match=f"{TRAINED} of these {TRAINED} pushes"):
        evaluate([model], store.first(TRAINED))


def test_it_is_a_model_in_control(model):
    planner = sn.make_planner("greedy")
    scene = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059])
    state = scene.in_a_row()
    goal = np.asarray(state.position[1]) + [0.03, 0.0]
    plan = planner.plan(model.dynamics, PushToGoal(jnp.asarray(goal)), scene, state)
    assert plan.distance < 0.025  # m; the goal is 30 mm ahead


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"kind": "direct-force"}, "kind is 'direct-force'"),
        ({"bodies": 3}, "3 disks"),
        ({"pushes": 4}, "4 pushes that are not repeats"),
    ],
)
def test_pushes_that_cannot_be_used_are_refused(changes, message, tmp_path):
    info = info_of(changes.pop("pushes", 12), **changes)
    if info.kind == "direct-force":
        store = generate(
            replace(PUSHES, setup="direct-force", pushes=8), tmp_path / "data"
        )
    else:
        write_store(tmp_path / "data", info, made_up(info))
        store = open_store(tmp_path / "data")
    with pytest.raises(BadStore, match=message):
        fit_process(store, tmp_path / "gp", PLANAR, ProcessSettings())
    assert not (tmp_path / "gp").exists()


def test_an_input_that_never_varies_is_refused(store):
    """One push, eight times."""
    one = store.take([0] * 8)
    with pytest.raises(BadStore, match="pushes: the contact angle is the same in all"):
        ends_of(one, PLANAR, "angle")


def test_a_process_without_an_input_is_the_remedy_where_that_never_varies(tmp_path):
    """All pushes begin with the same poses, and a refusal leaves nothing behind."""
    info = info_of(12)
    arrays = made_up(info)
    for name in ("initial", "initial_pusher"):
        arrays[name][:] = arrays[name][:1]
    write_store(tmp_path / "data", info, arrays)
    store, out = open_store(tmp_path / "data"), tmp_path / "gp"
    with pytest.raises(BadStore, match="side of the disk is the same .* without it"):
        fit_process(store, out, PLANAR, ProcessSettings(features="place"))
    assert not out.exists()


@pytest.mark.parametrize(
    ("seen", "says"), [(2, "2 pushes of at"), (4, "4 pushes that")]
)
def test_too_few_known_ends_leave_no_folder(tmp_path, seen, says):
    info = info_of(12)
    arrays = made_up(info)
    arrays["initial_pusher"][:, 1] += np.linspace(-0.02, 0.02, 12)
    arrays["pose_observed"] &= np.arange(12)[:, None] < seen
    write_store(tmp_path / "data", info, arrays)
    store, out = open_store(tmp_path / "data"), tmp_path / "gp"
    with pytest.raises(BadStore, match=says):
        fit_process(store, out, PLANAR, ProcessSettings(features="angle"))
    assert not out.exists()


def test_pushes_that_the_engine_was_identified_on_are_refused(store, tests, tmp_path):
    engine = structs.replace(PLANAR, pushes=digests_to_text(tests.push_hashes()))
    fit_process(store.first(TRAINED), tmp_path, engine, QUICK)
    with pytest.raises(BadCheckpoint, match="was trained on 15 of these 15"):
        evaluate([load_model(str(tmp_path))], tests)
    fit_process(store.first(TRAINED), tmp_path, PLANAR, QUICK)  # the same settings


def edited(folder, tmp_path, **changes):
    for name in (PROCESS, ARRAYS):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    card = json.loads((tmp_path / PROCESS).read_text())
    (tmp_path / PROCESS).write_text(json.dumps(card | changes))
    return str(tmp_path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"weights": "0" * 64}, "seal: the file was edited. Fit it again"),
        ({"trained_pushes": 7}, "seal"),
        ({"pushes": ""}, "seal"),
        ({"camera": {"shift_mm": [30.0, 0.0]}}, "process.json"),
        ({"disks": 3}, "disks"),
        ({"inputs": ["contact_angle"]}, "seal"),
        ({"inputs": ["../x"]}, "inputs"),
        ({"seal": ""}, "seal"),
        ({"kind": "direct-force"}, "kind"),
        ({"format_version": 2}, "format_version"),
    ],
)
def test_an_edited_card_is_refused(folder, tmp_path, changes, message):
    with pytest.raises(BadCheckpoint, match=message) as refused:
        load_model(edited(folder, tmp_path, **changes))
    assert "\n" not in str(refused.value)


def test_an_edited_property_of_the_engine_is_refused(folder, tmp_path):
    identity = json.loads((folder / PROCESS).read_text())["identity"]
    identity["simulator"]["assumptions"]["table_friction"] = 0.6
    with pytest.raises(BadCheckpoint, match="seal: the file was edited"):
        load_model(edited(folder, tmp_path, identity=identity))


def test_edited_arrays_are_refused(folder, tmp_path):
    name = edited(folder, tmp_path)
    data = bytearray((tmp_path / ARRAYS).read_bytes())
    data[-9] ^= 1
    (tmp_path / ARRAYS).write_bytes(data)
    with pytest.raises(BadCheckpoint, match="its hash is another"):
        load_model(name)
    (tmp_path / ARRAYS).write_bytes(data[:100])
    with pytest.raises(BadCheckpoint, match="truncated"):
        load_model(name)


def test_tune_identifies_the_engine_first(store, tmp_path):
    some = sn.open_pushes(store.path).take(range(12))
    found = sn.tune("gp", some, iterations=3, out=tmp_path / "gp")
    assert found.id.kind == "gp"
    assert (tmp_path / "gp" / "engine" / "identified.json").is_file()
    again = sn.load(tmp_path / "gp")
    assert again.digest == found.digest


def test_its_report_says_what_it_is(folder):
    page = page_of(folder)
    assert f"from {TRAINED} pushes that the engine planar simulated, of 2 disks" in page
    assert "bearing, contact angle" in page


def test_settings_of_networks_are_refused(store):
    with pytest.raises(BadInput, match="`recipe` and `start` are of networks"):
        sn.tune("gp", store, start="sain")
    with pytest.raises(BadInput, match="`features` and `choose` are of `gp`"):
        sn.tune("sain", store, features="side")


# The same kernels of another library.
REFERENCES = {
    "matern-3/2": kernels.Matern32(distance=L2Distance()),
    "matern-5/2": kernels.Matern52(distance=L2Distance()),
    "squared-exponential": kernels.ExpSquared(),
}
every_kernel = pytest.mark.parametrize("name", KERNELS)


@every_kernel
@pytest.mark.parametrize("inputs", [1, 3])
@pytest.mark.parametrize("pushes", [1, 5, 40])
def test_the_loss_is_the_density_of_scipy(pushes, inputs, name):
    rng = np.random.default_rng(pushes)
    places, values = rng.normal(size=(pushes, inputs)), rng.normal(size=pushes)
    at = np.array([0.1, -0.7, *[1.0] * inputs])

    def wanted(at):
        scaled = transforms.Linear(jnp.exp(-at[2:]), REFERENCES[name])
        covariance = jnp.exp(2 * at[0]) * scaled(places, places)
        covariance = np.asarray(covariance) + np.exp(2 * at[1]) * np.eye(pushes)
        return -multivariate_normal(cov=covariance).logpdf(values)

    with jax.enable_x64(True):
        found, slope = loss_and_slope(at, places, values, name, prior=at)
        assert found == pytest.approx(wanted(at))
        for place in range(len(at)):
            step = 1e-5 * np.eye(len(at))[place]
            about = (wanted(at + step) - wanted(at - step)) / 2e-5
            assert slope[place] == pytest.approx(about, rel=1e-4, abs=1e-5)


@every_kernel
def test_a_correlation_has_a_slope_where_points_coincide(name):
    places = jnp.asarray(np.random.default_rng(0).normal(size=(4, 3)), jnp.float32)
    slope = jax.grad(lambda other: correlation(name, places, other).sum())(places)
    wanted = jax.grad(lambda other: REFERENCES[name](places, other).sum())(places)
    np.testing.assert_allclose(slope, wanted, atol=1e-5)
    assert np.abs(wanted).max() > 0.1


def test_a_choice_takes_the_best_on_pushes_left_out(store, tmp_path):
    allowed = ProcessSettings(features="side", iterations=8, folds=2, choose=True)
    some, calls, out = store.first(24), [], tmp_path / "gp"
    fit_process(some, out, PLANAR, allowed, on_output=lambda: calls.append(0))
    assert len(calls) == fits_of(some, allowed) == 6 * 2 * 3 * 3
    found = load_model(str(out)).card
    assert found.recipe in allowed.options
    assert found.identity.features == found.recipe.features

    def missed(settings):
        ends = ends_of(some, PLANAR, settings.features)
        owner, mean = fold_of_push(ends.kinds, 2, 0), np.empty_like(ends.rates)
        whole, _ = fit_to(ends, settings)
        at = np.log(np.c_[whole.amplitude, np.sqrt(whole.noise), whole.length])
        for fold in range(2):
            part, _ = fit_to(ends.take(owner != fold), settings, begin=at)
            held = owner == fold
            mean[held] = rates_at(part, ends.inputs[held])[0]
        off = ends.rates - share_of(mean, ends.rates) * mean
        off, whole = (x.reshape(len(x), 2, 3) for x in (off, ends.rates))
        place = np.hypot(*off.T[:2]).mean(axis=1) / np.hypot(*whole.T[:2]).mean(axis=1)
        turned = np.abs(off[..., 2]).mean(axis=0) / np.abs(whole[..., 2]).mean(axis=0)
        return np.mean([place, turned])

    best = min(allowed.options, key=missed)
    assert (found.recipe.features, found.recipe.kernel) == (best.features, best.kernel)
