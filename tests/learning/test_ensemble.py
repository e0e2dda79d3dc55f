"""Ensembles: the mean of their members, their regions, their files and refusals."""

import html
import json
import shutil

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import sainet as sn
from learning.stores import info_of, made_up, write
from sainet.cli.entry import run
from sainet.datasets.batch import to_batch
from sainet.datasets.splits import split_rows
from sainet.engines.simulator import SIMULATORS, InternalEngine
from sainet.evaluation.coverage import coverage_of
from sainet.evaluation.evaluate import evaluate
from sainet.learning import ensemble as ensemble_module
from sainet.learning.ensemble import CALIBRATION, fit_ensemble
from sainet.learning.fit import fit
from sainet.learning.log import read_log
from sainet.learning.recipes import PAPER, SingleSteps
from sainet.models.dynamics import predict
from sainet.models.ensemble_card import ENSEMBLE, member
from sainet.models.library import load_model
from sainet.runs.digests import digests_to_text
from sainet.runs.errors import BadCheckpoint, BadInput, BadSetting, BadStore
from sainet.scenes.pushes import command_path
from sainet.scenes.recording import AGREES
from sainet.scenes.state import pack_motion
from sainet.studies.run_report import page_of

PUSHES, MEMBERS = 60, 3
RECIPE = PAPER.changed(iterations=3, batch_size=8, steps=12, log_every=1)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    info = info_of(PUSHES)
    return write(tmp_path_factory.mktemp("pushes") / "data", info, made_up(info))


@pytest.fixture(scope="module", params=["in", "sain"])
def folder(request, store, tmp_path_factory):
    out = tmp_path_factory.mktemp("ensemble") / request.param
    fit_ensemble(request.param, store, RECIPE, out, members=MEMBERS)
    return out


@pytest.fixture(scope="module")
def batch(store):
    return to_batch(store.read(slice(5)), store.info)


def motion(model, batch):
    states = predict(model.dynamics, batch.scene, batch.initial, batch.controls).states
    return np.asarray(pack_motion(states))


def test_the_mean_of_the_members_is_predicted(folder, batch):
    each = [motion(load_model(str(member(folder, n))), batch) for n in range(MEMBERS)]
    assert np.ptp(np.stack(each), axis=0).max() > 1e-4
    found = motion(load_model(str(folder)), batch)
    assert np.allclose(found, np.mean(each, axis=0), atol=1e-5)


def test_the_report_of_an_ensemble_says_what_it_is(folder, store):
    page = html.unescape(page_of(folder))
    rest, held = split_rows(store.repeats(), CALIBRATION, RECIPE.seed)
    assert f", ensemble, from {len(rest)} " in page
    assert len(rest) + len(held) == PUSHES
    assert f"the mean of {MEMBERS} networks" in page
    assert "in which region a push ends" in page


def test_two_advances_are_one_long_one(folder, batch):
    dynamics = load_model(str(folder)).dynamics
    whole = motion(load_model(str(folder)), batch)
    carry, parts = dynamics.begin(batch.scene, batch.initial), []
    for part in (slice(0, 5), slice(5, None)):
        controls = jax.tree.map(lambda x, part=part: x[:, part], batch.controls)
        carry, trajectory = dynamics.advance(batch.scene, carry, controls)
        parts.append(np.asarray(pack_motion(trajectory.states)))
    assert np.allclose(np.concatenate(parts, axis=1), whole, atol=1e-5)


def test_regions_hold_the_pushes_that_calibrated_them(folder, store):
    """Of 12 pushes, the quantile is the largest score, of a push on the boundary."""
    _, held = split_rows(store.repeats(), CALIBRATION, RECIPE.seed)
    card = json.loads((folder / ENSEMBLE).read_text())
    assert card["calibrated_on"] == len(held) == PUSHES / 5
    tests = store.take(np.sort(held))
    found = coverage_of(evaluate([load_model(str(folder))], tests, force=True))
    assert {each.kind for each in found} == {"pos", "rot"}
    assert all(each.inside.value > 90 for each in found)
    assert all(each.size.value > 0 for each in found)


def test_what_disagreement_lacks_is_a_floor_and_nine_tenths_are_within_reach(
    folder, store, monkeypatch
):
    rng = np.random.default_rng(0)
    spread = rng.uniform(0.5, 1.5, (PUSHES, 2, 3)) * [1e-3, 1e-3, 0.02]
    spread[:, 1, 2] = 0.5  # rad: members disagree by more than they err
    missed = np.array([2e-3, 3e-3, 0.05]) * rng.normal(size=(PUSHES, 2, 3))
    missed[7] = np.nan  # not observed
    both = missed, spread
    monkeypatch.setattr(ensemble_module, "_missed_and_spread", lambda *given: both)
    dynamics = load_model(str(folder)).dynamics
    found = ensemble_module._calibrate(dynamics, AGREES, store)
    known = np.delete(missed, 7, axis=0), np.delete(spread, 7, axis=0)
    assert found.calibrated_on == PUSHES - 1
    for body in range(2):
        lacking = np.mean([off[body] ** 2 for off in known[0]], axis=0)
        least = 0.01 * lacking
        lacking = lacking - np.mean([s[body] ** 2 for s in known[1]], axis=0)
        lacking = np.maximum(lacking, least)
        place, turn = np.sqrt([(lacking[0] + lacking[1]) / 2, lacking[2]])
        assert found.floor[body] == pytest.approx((place, turn))
        scaled, plain = [], []
        for off, own in zip(known[0][:, body], known[1][:, body], strict=True):
            width = np.sqrt(own**2 + np.array([place, place, turn]) ** 2)
            x, y, angle = off / width
            scaled.append((np.hypot(x, y), abs(angle)))
            plain.append((np.hypot(*off[:2]), abs(off[2])))
        nine_tenths = int(np.ceil(0.9 * PUSHES)) - 1
        for values, limits in ((scaled, found.reach), (plain, found.plain)):
            wanted = np.sort(values, axis=0)[nine_tenths]
            np.testing.assert_allclose(limits[body], wanted)


def test_regions_grow_with_disagreement(folder, batch):
    dynamics = load_model(str(folder)).dynamics
    given = batch.scene, batch.initial, batch.controls
    spread, region = dynamics.spread(*given), dynamics.region(*given)
    ends = [
        load_model(str(member(folder, n))).dynamics.advance(
            batch.scene,
            load_model(str(member(folder, n))).dynamics.begin(*given[:2]),
            batch.controls,
        )[1]
        for n in range(MEMBERS)
    ]
    angles = np.stack([np.asarray(each.final.angle) for each in ends])
    assert np.allclose(spread.turn, angles.std(axis=0), atol=1e-5)
    places = np.stack([np.asarray(each.final.position) for each in ends])
    assert np.allclose(
        np.sum(np.asarray(spread.place) ** 2, axis=-1),
        np.sum(places.var(axis=0), axis=-1),
        atol=1e-7,
    )
    order = np.argsort(np.asarray(spread.turn)[:, 0])
    assert (np.diff(np.asarray(region.turn)[order, 0]) >= 0).all()


def test_no_member_is_trained_on_the_pushes_of_the_calibration(folder, store):
    trained = [load_model(str(member(folder, n))).card.trained_pushes for n in range(3)]
    assert trained == [PUSHES * 4 / 5] * MEMBERS
    with pytest.raises(BadCheckpoint, match=f"{ENSEMBLE}.*ensemble was trained on 60"):
        evaluate([load_model(str(folder))], store)


def test_pushes_that_the_engine_was_identified_on_are_refused(store, tmp_path):
    known = digests_to_text(store.push_hashes()[-15:])
    engine = InternalEngine(SIMULATORS["planar"], pushes=known)
    some = store.first(50)
    fit_ensemble("sain", some, RECIPE, tmp_path, members=2, engine=engine)
    with pytest.raises(BadCheckpoint, match="was trained on 10 of these 10"):
        evaluate([load_model(str(tmp_path))], store.take(range(50, 60)))
    with pytest.raises(BadCheckpoint, match="network was trained on 10 of these 10"):
        evaluate([load_model(str(member(tmp_path, 1)))], store.take(range(50, 60)))


def test_members_are_networks_of_consecutive_seeds(folder, store, tmp_path):
    rest, _ = split_rows(store.repeats(), CALIBRATION, RECIPE.seed)
    alone = RECIPE.changed(seed=RECIPE.seed + 1)
    fit(folder.name, store.take(np.sort(rest)), alone, tmp_path / "alone")
    wanted = load_model(str(tmp_path / "alone")).card.weights
    assert load_model(str(member(folder, 1))).card.weights == wanted


def test_members_train_at_once_on_a_gpu(store, folder, tmp_path, monkeypatch):
    # Everything but the kernels, which need the GPU itself.
    monkeypatch.setattr(ensemble_module, "is_one_gpu", lambda: True)
    steps = []
    name = folder.name
    fit_ensemble(
        name,
        store,
        RECIPE,
        tmp_path / "out",
        members=MEMBERS,
        on_step=lambda done, loss: steps.append(done),
    )
    assert steps == [3, 6, 9]  # of all members together
    found, wanted = (read_log(member(p, 2)) for p in (tmp_path / "out", folder))
    for one, two in zip(found, wanted, strict=True):
        assert one.loss == pytest.approx(two.loss, rel=1e-3)


def test_an_identical_call_changes_nothing(folder, store):
    before = {p: p.stat().st_mtime_ns for p in folder.rglob("*") if p.is_file()}
    reporting = RECIPE.changed(log_every=2, checkpoint_every=7)
    planar = InternalEngine(SIMULATORS["planar"], pushes="AAAAAAAA")
    for recipe, engine in ((RECIPE, "planar"), (reporting, planar)):
        fit_ensemble(folder.name, store, recipe, folder, members=MEMBERS, engine=engine)
    assert {p: p.stat().st_mtime_ns for p in folder.rglob("*") if p.is_file()} == before


def test_ensembles_of_one_first_member_have_hashes_of_their_own(
    folder, store, tmp_path
):
    fit_ensemble(folder.name, store, RECIPE, tmp_path / "few", members=MEMBERS - 1)
    first = [load_model(str(member(f, 0))) for f in (folder, tmp_path / "few")]
    assert first[0].digest == first[1].digest
    assert load_model(str(folder)).digest == load_model(str(folder)).digest
    assert load_model(str(folder)).digest != load_model(str(tmp_path / "few")).digest


def test_edited_ensembles_are_refused(folder, tmp_path):
    for name, value, message in (
        ("members", ["0" * 64] * MEMBERS, "seal: the file was edited"),
        ("reach", [[0.1, 0.1]] * 2, "seal: the file was edited"),
        ("reach", [[1.0, 1.0]], "differ in their numbers"),
        ("floor", [[0.0, 1.0]] * 2, "floor"),
    ):
        other = shutil.copytree(folder, tmp_path / name, dirs_exist_ok=True)
        card = json.loads((other / ENSEMBLE).read_text())
        (other / ENSEMBLE).write_text(json.dumps(card | {name: value}))
        with pytest.raises(BadCheckpoint, match=message):
            load_model(str(other))
    other = shutil.copytree(folder, tmp_path / "other-member")
    shutil.rmtree(member(other, 0))
    shutil.copytree(member(other, 1), member(other, 0))
    with pytest.raises(BadCheckpoint, match="members.0. is not the hash"):
        load_model(str(other))
    other = shutil.copytree(folder, tmp_path / "missing")
    shutil.rmtree(member(other, 2))
    with pytest.raises(BadCheckpoint, match="member-2"):
        load_model(str(other))


def test_impossible_ensembles_are_refused(store, tmp_path):
    with pytest.raises(BadSetting, match="members. is 1"):
        fit_ensemble("in", store, RECIPE, tmp_path / "a", members=1)
    single = RECIPE.changed(horizon=SingleSteps(steps=12))
    with pytest.raises(BadSetting, match="single steps"):
        fit_ensemble("in", store, single, tmp_path / "b", members=2)
    with pytest.raises(BadStore, match="4 would calibrate"):
        fit_ensemble("in", store.first(20), RECIPE, tmp_path / "c", members=2)
    with pytest.raises(BadInput, match="`features` is contact"):
        contact = RECIPE.changed(features="contact")
        fit_ensemble("sain", store, contact, tmp_path / "d", members=2)
    with pytest.raises(BadSetting, match="`seed` is 4294967296"):
        last = RECIPE.changed(seed=2**32 - 1)
        fit_ensemble("in", store, last, tmp_path / "e", members=2)
    assert not list(tmp_path.iterdir())


def test_the_command_trains_an_ensemble_that_plans(store, tmp_path, capsys):
    words = ["train", "in", "--data", str(store.path), "--out", str(tmp_path / "out")]
    given = ["--iterations", "2", "--batch-size", "8", "--members", "2", "--json"]
    assert run([*words, *given]) == 0
    assert json.loads(capsys.readouterr().out)["model"] == "in"
    model = load_model(str(tmp_path / "out"))
    assert model.dynamics.has_regions
    assert model.card.identity.label.endswith("ensemble")


def test_other_numbers_of_disks_have_no_regions(folder):
    dynamics = load_model(str(folder)).dynamics
    scene = sn.Scene.disks([1.0] * 3, [0.05] * 3)
    three, push = scene.in_a_row(), sn.Push(0.1)
    given = jax.tree.map(lambda x: jnp.asarray(x)[None], (scene, three, push))
    initial, controls = command_path(*given, steps=12)
    assert dynamics.region(given[0], initial, controls) is None


def test_a_process_has_no_members(store, tmp_path, capsys):
    words = ["tune", "gp", "--data", str(store.path), "--out", str(tmp_path / "gp")]
    assert run([*words, "--members", "3"]) == 2
    assert "members" in capsys.readouterr().err
