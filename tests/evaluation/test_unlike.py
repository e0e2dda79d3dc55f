"""Warnings of models that were fitted to other pushes than they predict."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from learning.stores import info_of, made_up
from models.samples import CARD
from sainet.datasets.groups import groups_of
from sainet.datasets.store import open_store
from sainet.datasets.writer import write_store
from sainet.engines import RECORDED
from sainet.evaluation.coverage import (
    MEASURED,
    Coverage,
    coverage_of,
    in_words,
    rows_of,
)
from sainet.evaluation.intervals import Estimate
from sainet.evaluation.measurements import Header, measurements_of
from sainet.evaluation.unlike import (
    doubts_of_training,
    other_groups,
    other_numbers,
    other_worlds,
    unlike_pushes,
)
from sainet.models.identity import ModelId
from sainet.models.library import load_model


def test_networks_of_another_world_are_named_in_one_line():
    models = [load_model(name) for name in ("physics", "in", "sain", "sain-stroke")]
    assert list(other_worlds(models[:3], "bullet")) == []
    recorded = list(other_worlds(models, RECORDED))
    assert [line.partition(":")[0] for line in recorded] == ["in, sain", "sain-stroke"]
    assert "simulated by bullet, but these are recorded pushes" in recorded[0]
    assert all("'sainet tune'" in line and "\n" not in line for line in recorded)
    (simulated,) = other_worlds(models, "planar")
    assert "but these are pushes simulated by planar" in simulated


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory):
    """Two pushes on ice, two on felt."""
    info = info_of(4, groups=("felt", "ice", "sand"))
    arrays = made_up(info) | {"group": np.array([1, 1, 0, 0])}
    folder = tmp_path_factory.mktemp("groups") / "data"
    write_store(folder, info, arrays)
    return open_store(folder)


def test_groups_are_those_of_the_pushes_that_were_chosen(store):
    assert groups_of([store]) == ("felt", "ice")
    assert groups_of([store.first(2)]) == ("ice",)
    assert groups_of([store.first(2), store.take([3])]) == ("felt", "ice")


def fitted_to(*groups: str):
    model = load_model("sain-stroke")
    assert model.card
    return replace(model, card=structs.replace(model.card, groups=groups))


def test_models_of_other_groups_are_warned_of(store):
    models = [load_model("physics"), fitted_to("ice"), fitted_to("felt", "ice")]
    (found,) = other_groups(models, groups_of([store]))
    assert found.startswith("sain-stroke: fitted to pushes of ice, ")
    assert "these are of felt." in found
    assert list(other_groups([fitted_to()], ("ice",))) == []  # unknown
    assert list(other_groups(models[1:], ("ice",))) == []
    assert found in list(unlike_pushes(models, store))


def test_a_network_for_another_number_of_disks_is_doubted(store):
    models = [fitted_to("felt", "ice"), load_model("sain")]
    (doubt,) = other_numbers(models, 2)
    assert doubt.startswith("sain-stroke: its network was trained on pushes of 1 disk")
    assert doubt.endswith("train one on such pushes.")
    assert doubt in list(unlike_pushes(models, store))


def test_a_network_with_few_or_other_training_pushes_is_doubted():
    few = structs.replace(CARD, trained_pushes=100)
    assert list(doubts_of_training(None, 3)) == []
    assert list(doubts_of_training(CARD, 2)) == []
    (doubt,) = doubts_of_training(few, 2)
    assert "trained on 100 pushes" in doubt
    (doubt,) = doubts_of_training(CARD, 3)
    assert "pushes of 2 disk(s) and may predict this scene of 3" in doubt


@pytest.mark.parametrize(
    ("inside", "is_doubted"), [((50, 40, 60), True), ((85, 78, 92), False)]
)
def test_regions_that_hold_clearly_too_few_ends_are_doubted(inside, is_doubted):
    size = Estimate(1.0, 0.9, 1.1)
    (sentence,) = in_words(
        [
            Coverage(
                condition="",
                model="gp",
                body=1,
                kind="pos",
                count=100,
                inside=Estimate(*inside),
                size=size,
                score=size,
                over_plain=size,
            )
        ],
        {"gp": "GP"},
    )
    assert ("fewer than they promise" in sentence) == is_doubted


@pytest.mark.parametrize(
    ("held", "folds", "words"),
    [
        ([1] * 20, None, "hold 100 % [84, 100] of the final positions"),
        ([0] * 2, None, "hold 0 % [0, 66] of the final positions"),
        ([1] * 20, [0, 1] * 10, "hold 100 % [84, 100] of the final positions"),
        ([1, 0] * 10, [0, 1] * 10, "hold 50 % [0, 100] of the final positions"),
        ([1], None, "too few pushes"),
    ],
)
def test_a_few_regions_that_all_hold_prove_little(held, folds, words):
    """Wilson's interval; over folds the bootstrap, unless all are inside or outside."""
    inside = np.array(held, float)[None, None, :, None]
    errors = {name: np.ones_like(inside) for name in MEASURED} | {"inside_pos": inside}
    rows = np.arange(len(held), dtype=np.int32)
    header = Header(models=(ModelId(kind="gp"),))
    found = measurements_of(errors, inside[0, 0], header, condition=0 * rows, row=rows)
    if folds:
        data = found.data.assign_coords(fold=("sample", np.array(folds, np.int32)))
        found = replace(found, data=data)
    assert words in in_words(coverage_of(found), {"gp": "GP"})[0]
    assert rows_of(found, [""])[0][1] == "Gaussian process"  # as in other tables
