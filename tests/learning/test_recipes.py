"""Recipes: one name for each setting, a recipe for each start, refused values."""

from dataclasses import replace

import msgspec
import pytest
from msgspec.structs import asdict

from sainet.learning.recipes import (
    CONTACT,
    FINE_TUNING,
    PAPER,
    RESIDUAL,
    Fresh,
    FromModel,
    FromSimulator,
    SingleSteps,
    recipe_for,
    start_named,
)
from sainet.models.card import TrainingSettings
from sainet.runs.documents import checked
from sainet.runs.errors import BadInput, BadSetting, UnknownName

AT_LEAST_ONE = ("iterations", "batch_size", "halve_every", "steps", "hold")
AT_LEAST_ONE += ("log_every", "checkpoint_every")
NOT_NEGATIVE = ("l2", "weight_position", "weight_rotation", "weight_velocity")
NOT_NEGATIVE += ("weight_spin", "validation_share", "patience", "average", "seed")
NOT_NEGATIVE += ("short_iterations",)
BAD = [(name, bad) for name in AT_LEAST_ONE for bad in (0, -3)]
BAD += [(n, bad) for n in ("learning_rate", "clip_norm") for bad in (0.0, -1.0)]
BAD += [(name, -1) for name in NOT_NEGATIVE]
BAD += [("seed", 2**32)]
BAD += [
    (name, bad)
    for name in ("learning_rate", "clip_norm", "l2", "weight_spin")
    for bad in (float("nan"), float("inf"))
]


@pytest.mark.parametrize(("name", "value"), BAD)
def test_an_impossible_setting_is_refused_by_its_name(name, value):
    with pytest.raises(BadSetting, match=f"^`{name}` is {value}"):
        PAPER.changed(**{name: value})


@pytest.mark.parametrize(
    ("name", "recipe"),
    [(None, PAPER), ("engine", RESIDUAL), ("in", FINE_TUNING)],
)
def test_the_recipe_fits_its_start(name, recipe):
    start = start_named(name)
    assert recipe_for(start) == replace(recipe, start=start)
    assert type(recipe.start) is type(start)


def test_every_setting_has_one_name_among_all_parts():
    own = {"iterations": 7, "l2": None, "hold": 3, "mirror": True, "features": "place"}
    changed = PAPER.changed(**own)
    assert (changed.optimiser.iterations, changed.horizon.hold) == (7, 3)
    assert asdict(changed.settings()) == asdict(PAPER.settings()) | own
    paper = asdict(PAPER.settings()) | {"horizon": PAPER.horizon}
    assert changed.changed(**paper) == PAPER


def test_documents_name_newer_settings_only_where_they_differ():
    names = {"decay", "short_iterations"}
    assert not names & msgspec.to_builtins(PAPER.settings()).keys()
    changed = PAPER.changed(decay="cosine", short_iterations=3).settings()
    written = msgspec.to_builtins(changed)
    assert (written["decay"], written["short_iterations"]) == ("cosine", 3)
    assert msgspec.convert(written, TrainingSettings) == changed


def test_settings_of_one_part_are_checked_together():
    both = PAPER.changed(patience=5, validation_share=0.2)
    assert (both.stopping.patience, both.stopping.validation_share) == (5, 0.2)


def test_a_misspelt_setting_is_named_with_the_nearest():
    with pytest.raises(UnknownName, match="iteration.*did you mean iterations"):
        PAPER.changed(iteration=7)


def test_single_steps_have_no_hold():
    single = RESIDUAL.changed(horizon=SingleSteps(), start=Fresh())
    assert single.settings().horizon == "single-steps"
    assert single.horizon.hold == 1
    with pytest.raises(UnknownName, match="hold"):
        single.changed(hold=2)


def test_a_start_from_a_model_or_the_simulator_is_no_name():
    assert start_named("sain") == FromModel("sain")
    assert start_named("engine") == FromSimulator()
    assert "sain" not in asdict(FINE_TUNING.settings()).values()


def test_unknown_terms_of_the_loss_are_refused():
    with pytest.raises(BadInput, match="terms"):
        checked(msgspec.structs.replace(PAPER.settings(), terms="errors"), "recipe")


def test_a_contact_network_keeps_its_hold_and_features_when_it_is_tuned_further():
    start = FromModel("sain-any")
    assert recipe_for(start, "contact").features == CONTACT.features == "contact"
    assert recipe_for(start, "contact").start == start
    assert recipe_for(FromSimulator(), "contact") == CONTACT
    assert recipe_for(start, "contact").horizon.hold == CONTACT.horizon.hold
    assert recipe_for(start).horizon.hold == 1
