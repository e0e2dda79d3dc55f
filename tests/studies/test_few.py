"""Studies of few recorded pushes, tiny and on made-up ones."""

from importlib.util import find_spec
from itertools import product

import numpy as np
import pytest

from learning.stores import end_points_alone, info_of, made_up, write
from models.samples import identified_folder
from sainet.evaluation.joining import join
from sainet.evaluation.measurements import Header, Measurements, measurements_of
from sainet.evaluation.metrics import MEASURED
from sainet.learning.recipes import FromModel, FromSimulator
from sainet.models.card import read_card
from sainet.studies import active_choice, load_study, recorded_few
from sainet.studies.cross_validation import PHYSICS_IDENTIFIED
from sainet.studies.data_efficiency import of_pushes
from sainet.studies.runner import Runner
from sainet.studies.study import STEPS, Scope
from support import require

PUSHES = 48


def _recorded(folder, pushes):
    """Return pushes of one disk that start at many places, in pairs of repeats."""
    info = info_of(
        pushes,
        engine="recorded",
        seed=None,
        bodies=1,
        steps=40,
        groups=("felt-10",),
        has_repeats=True,
    )
    arrays = end_points_alone(made_up(info))
    for name in ("initial", "truth", "simulated_planar"):
        _along(arrays[name])
    for name in ("initial_pusher", "truth_pusher", "command_position"):
        _along(arrays[name])
    arrays |= {"repeat": np.repeat(np.arange(pushes // 2), 2)}
    arrays |= {"mass": np.ones_like(arrays["mass"])}
    names = ("table_friction", "disk_friction", "pusher_friction")
    arrays |= dict.fromkeys(names, np.full(pushes, 0.3))
    return write(folder / "data", info, arrays).path


def _along(places):
    """Moves each push by 2 mm more than the one before, so that places differ."""
    shift = 0.002 * np.arange(len(places))
    places[..., 0] += shift.reshape(-1, *[1] * (places.ndim - 2))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Pushes of one disk."""
    return _recorded(tmp_path_factory.mktemp("few"), PUSHES)


@pytest.fixture(autouse=True)
def all_pushes(monkeypatch):
    monkeypatch.setattr("sainet.studies.study.QUICK_RECORDED", PUSHES)


def test_the_quick_scale_takes_pushes_from_the_whole_of_a_group(recorded, monkeypatch):
    monkeypatch.setattr("sainet.studies.study.QUICK_RECORDED", 5)
    few = Scope("quick", recorded).recorded_pushes()
    assert few.rows == (
        0,
        *(round(n * (PUSHES - 1) / 4) for n in (1, 2, 3)),
        PUSHES - 1,
    )
    assert Scope("paper", recorded).recorded_pushes().info.pushes == PUSHES


def test_orders_begin_alike_and_are_tested_on_other_kinds(
    recorded, tmp_path, monkeypatch
):
    monkeypatch.setattr(active_choice, "DRAWS", {"quick": 1})
    monkeypatch.setattr(active_choice, "COUNTS", {"quick": (12, 18)})
    study, scope = load_study("recorded-active"), Scope("quick", recorded)
    step = study.plan(scope).measured
    measured = Runner(tmp_path / STEPS).result(step)
    assert [c.label for c in measured.header.conditions] == ["12", "18"]
    first, later = (measured.data["condition"].values == n for n in (0, 1))
    random, chosen = (
        measured.values("final_pos_mm", name)[..., :, 0].ravel()
        for name in ("at-random", "chosen")
    )
    assert (random[first] == chosen[first]).all()  # of the same pushes
    assert (random[later] != chosen[later]).any()
    physics = measured.values("final_pos_mm", "physics-identified").ravel()
    assert (physics[first] == physics[later]).all()
    assert first.sum() == PUSHES / 4


@pytest.mark.parametrize(
    ("scale", "schemes", "iterations"),
    [("quick", ["kind"], 10), ("paper", ["kind", "place"], 1200)],
)
def test_networks_and_ensembles_share_their_folds(tmp_path, scale, schemes, iterations):
    recorded = _recorded(tmp_path, 120)
    plan = load_study("recorded-ensembles").plan(Scope(scale, recorded))
    parts = plan.measured.parts
    assert [part.condition.label for part in parts] == schemes
    for part in parts:
        for fold in part.parts:
            *networks, process = (each.candidate for each in fold.fitted)
            assert process.identity.slug == "gp-identified-place"
            features = ("paper", "place") if scale == "paper" else ("paper",)
            assert [(n.variant.features, n.identity.variant) for n in networks] == [
                (name, variant) for name in features for variant in ("", "ensemble")
            ]
            pushes = fold.engine.pushes.store
            recipes = [n.recipe(pushes.info.pushes) for n in networks]
            trained = {recipe.optimiser.iterations for recipe in recipes}
            assert trained == {iterations}


@pytest.mark.slow
def test_pushes_of_labs_are_chosen_too(tmp_path, monkeypatch):
    require(find_spec("mujoco"), "MuJoCo is not installed")
    monkeypatch.setattr(active_choice, "LABS", {"quick": (2, 30)})
    monkeypatch.setattr(active_choice, "COUNTS", {"quick": (10, 12)})
    draws = load_study("lab-active").plan(Scope("quick", None)).measured.parts
    assert [draw.pushes.config.lab for draw in draws] == [0, 1]
    found = Runner(tmp_path / STEPS).result(draws[0])
    for name in ("physics-identified", "at-random", "chosen"):
        values = found.values("final_pos_mm", name)
        assert values.shape[-1] == 2  # both disks
        assert (values > 0).all()
        assert values.max() < 20


def test_few_pushes_are_parts_of_more(recorded, monkeypatch):
    monkeypatch.setattr(recorded_few, "COUNTS", {"quick": (10, 12)})
    study = load_study("recorded-few")
    parts = study.plan(Scope("quick", recorded)).measured.parts
    fewer, more = (
        [set(step.engine.pushes.store.rows) for step in part.parts] for part in parts
    )
    assert [len(rows) for rows in fewer] == [10, 10]
    assert all(one < other for one, other in zip(fewer, more, strict=True))
    tests = [set(step.pushes.store.rows) for step in parts[0].parts]
    assert not any(rows & held for rows, held in zip(more, tests, strict=True))
    without_engine, around_assumed, around_identified, *_ = parts[0].parts[0].fitted
    assert [each.name for each in parts[0].parts[0].fitted] == [
        "in-tuned",
        "sain-tuned",
        "sain-identified-residual",
        "gp-identified-side",
        "gp-identified-place",
    ]
    assert without_engine.candidate.recipe(10).start == FromModel("in-stroke")
    assert around_assumed.candidate.recipe(10).start == FromModel("sain-stroke")
    assert around_identified.candidate.recipe(10).start == FromSimulator()


@pytest.mark.slow
def test_networks_of_few_pushes_are_made_around_the_engine_that_they_name(
    make, recorded, tmp_path, monkeypatch
):
    monkeypatch.setattr(recorded_few, "COUNTS", {"quick": (10, 12)})
    monkeypatch.setattr(recorded_few, "NETWORKS", recorded_few.NETWORKS[1:])
    monkeypatch.setattr(recorded_few, "PROCESSES", ())
    # Of one size, so that everything compiles once.
    small = lambda recipe, *_: recipe.changed(iterations=1, batch_size=4)  # noqa: E731
    monkeypatch.setattr("sainet.studies.recorded_models.scaled", small)
    found = lambda store, folder: identified_folder(folder, pusher_friction=0.3)  # noqa: E731
    monkeypatch.setattr("sainet.studies.cross_validation.identify_into", found)
    table = make("recorded-few", recorded)
    rows = [(row["group"], row["model"]) for row in table["rows"]]
    models = ("physics", "physics-identified", "sain-tuned", "sain-identified-residual")
    assert sorted(rows) == sorted(product(("10", "12"), models))
    assert (tmp_path / "recorded-few" / "recorded-few.svg").is_file()
    cards = [read_card(path.parent) for path in (tmp_path / STEPS).rglob("card.json")]
    assert {card.internal.simulator.is_identified for card in cards} == {True, False}
    for card in cards:
        assert card.internal.simulator.is_identified == (card.started_from is None)


def test_the_saving_is_where_the_curves_meet():
    """Errors 40 / count at random, 20 / count when chosen: half as many pushes."""
    counts, draws, tests = (25, 50, 100, 200), 6, 5
    parts = []
    for count in counts:
        errors = np.empty((3, 1, draws * tests, 1))
        errors[0], errors[1], errors[2] = 1.0, 40 / count, 20 / count
        header = Header(
            models=(PHYSICS_IDENTIFIED, active_choice.RANDOM, active_choice.CHOSEN)
        )
        part = measurements_of(
            dict.fromkeys(MEASURED, errors),
            np.ones((draws * tests, 1)),
            header,
            condition=np.zeros(draws * tests),
            row=np.arange(draws * tests),
        )
        parts.append(part.in_condition(of_pushes(count)))
    whole = join(parts)
    folds = np.tile(np.repeat(np.arange(draws), tests), len(counts)).astype(np.int32)
    data = whole.data.assign_coords(fold=("sample", folds))
    found = active_choice.pushes_for_the_last(
        Measurements(data, whole.header), "final_pos_mm"
    )
    assert found.value == found.low == found.high == pytest.approx(100)
