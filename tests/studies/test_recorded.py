"""The tables of recorded pushes, tiny and on made-up ones: who is made of what."""

from itertools import product

import numpy as np
import pytest

from learning.stores import end_points_alone, info_of, made_up, write
from models.samples import identified_folder
from sainet.datasets.surrogate import Robot
from sainet.learning.recipes import FROM_ENGINE
from sainet.models.card import read_card, read_identified
from sainet.models.library import load_model
from sainet.runs.errors import BadInput
from sainet.studies import fine_tuning, load_study, recorded_pushes
from sainet.studies.fine_tuning import Way
from sainet.studies.recorded_models import TunedModels, Variant, surfaces_of
from sainet.studies.runner import Runner
from sainet.studies.study import STEPS, Change, Scope

FEW = (
    Variant("sain", "simulation", "identified"),
    Variant("sain", "residual", "identified"),
    Variant("sain", "tuned", features="place"),
)


@pytest.fixture
def recorded(tmp_path):
    """Twelve pushes on each of two surfaces, in pairs of repeats."""
    info = info_of(
        24,
        engine="recorded",
        seed=None,
        bodies=1,
        groups=("abs-10", "abs-20", "plywood-10"),
        published=("convex",),
        has_repeats=True,
    )
    arrays = end_points_alone(made_up(info))
    arrays |= {"group": np.repeat([0, 1, 2], [6, 6, 12])}
    arrays |= {"repeat": np.repeat(np.arange(12), 2)}
    arrays |= {"published_convex": arrays["initial"][..., :3]}
    return write(tmp_path / "recorded", info, arrays)


def identify(store, folder):
    """Stands in for identification: the first push decides what is found."""
    found = 0.2 + 0.1 * float(store.read(slice(1), ("mass",))["mass"][0, 0])
    identified_folder(folder, pusher_friction=found, camera_x_mm=1.0)


@pytest.fixture
def tuned(make, recorded, monkeypatch):
    """Runs a study of recorded pushes, with a few tiny networks."""
    monkeypatch.setattr(recorded_pushes, "VARIANTS", FEW)
    monkeypatch.setattr(recorded_pushes, "FOR_ALL", FEW[1:2])
    monkeypatch.setattr(recorded_pushes, "ELSEWHERE", FEW[:2])
    # Of one size, so that everything compiles once.
    small = lambda recipe, *_: recipe.changed(iterations=1, batch_size=4)  # noqa: E731
    monkeypatch.setattr("sainet.studies.recorded_models.scaled", small)
    # It has tests of its own, and compiles for a minute.
    monkeypatch.setattr("sainet.studies.steps.identify_into", identify)
    return lambda name: make(name, recorded.path)


def test_surfaces_are_groups_without_their_speed(recorded):
    found = {name: rows.tolist() for name, rows in surfaces_of(recorded).items()}
    assert found == {"abs": [*range(12)], "plywood": [*range(12, 24)]}


def test_without_recorded_pushes_there_is_no_table():
    for name in ("recorded-pushes", "recorded-few"):
        with pytest.raises(BadInput, match="`recorded` is missing"):
            load_study(name).check(Scope("quick"))


def test_a_shipped_network_around_an_identified_engine_names_that_engine(
    recorded, tmp_path
):
    """Stored predictions of the engine that it was trained around must not be used."""
    runner = Runner(tmp_path)
    tuned = TunedModels(recorded, "quick")
    identify(recorded, runner.folder(tuned.identified))
    step = tuned.model(FEW[0])
    model = step.run(runner)
    engine = read_identified(runner.folder(tuned.identified)).engine
    assert model.internal == engine != load_model("sain-stroke").internal


@pytest.mark.slow
def test_no_push_is_predicted_by_a_network_trained_on_it(tuned, tmp_path):
    table = tuned("recorded-pushes")
    names = {"physics", "physics-identified"}
    names |= {each.identity().slug for each in FEW}
    subject = "sain-identified-residual"
    everywhere = {*names, f"{subject}-for-all"}
    rows = {(row["group"], row["model"]): row for row in table["rows"]}
    groups = {"abs": 12, "plywood": 12, "all": 24}
    for group, count in groups.items():
        assert {model for where, model in rows if where == group} == everywhere
        assert {rows[group, model]["n"] for model in everywhere} == {count}
        assert rows[group, "physics"]["final_pos_mm_interval"][0] is not None
    elsewhere = {where for where, _ in rows} - groups.keys()
    assert elsewhere == {"abs to plywood, 0 of it", "abs to plywood, 50 of it"}
    assert {row["model"] for row in table["published"]} == {"convex"}
    against = {row["against"] for row in table["comparisons"]}
    assert against == (everywhere | {"convex"}) - {subject}
    folder = tmp_path / "recorded-pushes"
    assert (folder / "engine-errors.svg").is_file()
    cards = {
        path.parent.name.rpartition("-")[0]: []
        for path in (tmp_path / STEPS).rglob("card.json")
    }
    for path in (tmp_path / STEPS).rglob("card.json"):
        cards[path.parent.name.rpartition("-")[0]].append(read_card(path.parent))
    # Two folds of each surface, two of both, and one surface for the other, twice.
    counts = {f"{subject}-seed-0": 4 + 2, "sain-tuned-place-seed-0": 4}
    counts |= {f"{subject}-for-all-seed-0": 2}
    assert {name: len(found) for name, found in cards.items()} == counts
    for added in cards[f"{subject}-seed-0"]:
        assert (added.started_from, added.integrator) == (None, "relaxing-residual")
        assert added.internal.simulator.is_identified
        assert added.identity.features == "paper"
    tuned_cards = cards["sain-tuned-place-seed-0"]
    assert {card.identity.features for card in tuned_cards} == {"place"}
    assert {card.started_from for card in tuned_cards} != {None}
    assert len({card.started_from for card in tuned_cards}) == 1
    # No two saw the same.
    assert len({card.data for found in cards.values() for card in found}) == 8


@pytest.mark.slow
def test_settings_of_tuning_are_compared_over_robots(make, monkeypatch, tmp_path):
    one = {"learning_rate": 1e-3, "mirror": False}
    robots = (Robot("a", assumed_friction=0.25), Robot("b", unexplained=0))
    monkeypatch.setattr(fine_tuning, "TRIED", {"quick": robots})
    monkeypatch.setattr(fine_tuning, "WAYS", (Way(FROM_ENGINE, Change(**one)),))
    monkeypatch.setattr(fine_tuning, "WAYS_WITH_FEW", (Way(FROM_ENGINE),))
    monkeypatch.setattr(fine_tuning, "TESTS", {"quick": 4})
    table = make("fine-tuning")
    rows = {(*row["group"].split("/")[:2], row["model"]): row for row in table["rows"]}
    many, few = "20-pushes", "10-pushes"
    assert rows.keys() == set(product("ab", (many, few), ("physics", "sain-tuned")))
    assert [(c["pushes"], c["change"]) for c in table["choices"]] == [
        (20, one),
        (10, {}),
    ]
    for choice, pushes in zip(table["choices"], (many, few), strict=True):
        scores = {
            robot: np.mean(
                [
                    rows[robot, pushes, "sain-tuned"][key]
                    / rows[robot, pushes, "physics"][key]
                    for key in ("final_pos_mm", "final_rot_deg")
                ]
            )
            for robot in "ab"
        }
        assert choice["start"] == "engine"
        assert choice["score"] == pytest.approx(np.mean([*scores.values()]))
        assert choice["scores"] == pytest.approx(scores)
    decided = {
        read_card(path.parent).recipe.l2
        for path in (tmp_path / STEPS).rglob("card.json")
    }
    assert decided == {1 / 20, 1 / 10}  # one over the pushes
