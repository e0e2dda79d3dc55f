"""The tables of recorded pushes, tiny and on made-up ones: who is made of what."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from learning.stores import end_points_alone, info_of, made_up, write
from models.samples import identified_folder
from sainet.models.card import read_card
from sainet.runs.errors import BadInput
from sainet.studies import (
    fine_tuning,
    load_experiment,
    recorded_efficiency,
    recorded_pushes,
)
from sainet.studies.recorded_models import Variant, surfaces_of
from sainet.studies.surrogate import Robot

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
def make(chain, recorded, monkeypatch, tmp_path):
    monkeypatch.setattr(recorded_pushes, "VARIANTS", FEW)
    monkeypatch.setattr(recorded_pushes, "FOR_ALL", FEW[1:2])
    monkeypatch.setattr(recorded_pushes, "ELSEWHERE", FEW[:2])
    monkeypatch.setattr(recorded_efficiency, "VARIANTS", FEW[1:2])
    monkeypatch.setattr(recorded_efficiency, "PUSHES", {"quick": (3, 5)})
    # Of one size, so that everything compiles once.
    small = lambda recipe, *_: recipe.changed(iterations=1, batch_size=4)  # noqa: E731
    monkeypatch.setattr("sainet.studies.recorded_models.scaled", small)
    # It has tests of its own, and compiles for a minute.
    monkeypatch.setattr("sainet.studies.recorded_models.identify_into", identify)
    whole = replace(chain, recorded=recorded.path)
    return lambda name: load_experiment(name)(
        "quick", replace(whole, out=tmp_path / name)
    ).to_json()


def test_surfaces_are_groups_without_their_speed(recorded):
    found = {name: rows.tolist() for name, rows in surfaces_of(recorded).items()}
    assert found == {"abs": [*range(12)], "plywood": [*range(12, 24)]}


def test_without_recorded_pushes_there_is_no_table(chain):
    for name in ("recorded-pushes", "recorded-data-efficiency"):
        with pytest.raises(BadInput, match="`recorded` is missing"):
            load_experiment(name)("quick", chain)


@pytest.mark.slow
def test_no_push_is_predicted_by_a_network_trained_on_it(make, tmp_path):
    table = make("recorded-pushes")
    names = {"physics", "physics-identified", *(each.name for each in FEW)}
    told = "sain-identified-residual"
    everywhere = {*names, f"{told}-for-all"}
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
    assert against == (everywhere | {"convex"}) - {told}
    folder = tmp_path / "recorded-pushes"
    assert (folder / "engine-errors.svg").is_file()
    cards = {
        path.parent.relative_to(folder).as_posix(): read_card(path.parent)
        for path in folder.rglob("card.json")
    }
    trained = {told, "sain-tuned-place"}
    assert {name for name in cards if name.startswith(("abs/", "ply"))} == {
        f"{surface}/fold-{fold}/{name}"
        for surface in ("abs", "plywood")
        for fold in (0, 1)
        for name in trained
    }
    added = cards[f"abs/fold-0/{told}"]
    assert (added.started_from, added.residual) == (None, True)
    assert added.internal.simulator.is_identified
    assert added.identity.features == "paper"
    tuned = [card for name, card in cards.items() if name.endswith("tuned-place")]
    assert {card.identity.features for card in tuned} == {"place"}
    assert {card.started_from for card in tuned} == {tuned[0].started_from} != {None}
    assert len({card.data for card in cards.values()}) == 8  # no two saw the same


@pytest.mark.slow
def test_settings_of_tuning_are_compared_over_robots(make, monkeypatch, tmp_path):
    one = {"learning_rate": 1e-3, "mirror": False}
    robots = (Robot("a", assumed_friction=0.25), Robot("b", unexplained=0))
    monkeypatch.setattr(fine_tuning, "ROBOTS", robots)
    monkeypatch.setattr(fine_tuning, "WAYS", (("engine", one),))
    monkeypatch.setattr(fine_tuning, "WAYS_WITH_FEW", (("engine", {}),))
    monkeypatch.setattr(fine_tuning, "_TESTS", {"quick": 4})
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
        path.parent.parent.name: read_card(path.parent).config["l2"]
        for path in (tmp_path / "fine-tuning").rglob("engine/card.json")
    }
    assert decided == {few: 0.1}  # one over the pushes


@pytest.mark.slow
def test_larger_training_sets_contain_the_smaller_sets(make, tmp_path):
    table = make("recorded-data-efficiency")
    groups = {row["group"] for row in table["rows"]}
    assert groups == {"3", "5"}
    assert {row["n"] for row in table["rows"]} == {24}
    folder = tmp_path / "recorded-data-efficiency"
    assert (folder / "recorded-data-efficiency.svg").is_file()
