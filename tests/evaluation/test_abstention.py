"""Models that abstain: the fitted model on its surfaces, the engine on all others."""

import json
from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

import sainet as sn
from learning.stores import end_points_alone, info_of, made_up, write
from models.samples import identified_folder
from sainet.cli.entry import run
from sainet.datasets.groups import surface_of
from sainet.evaluation.abstention import (
    abstaining,
    keeps_to_engine,
    measure,
    with_abstaining,
)
from sainet.evaluation.coverage import coverage_of
from sainet.evaluation.evaluate import evaluate
from sainet.evaluation.measurements import Condition
from sainet.evaluation.summary import summarise
from sainet.models.card import IDENTIFIED, read_identified
from sainet.models.correctors import Region
from sainet.models.dynamics import PhysicsDynamics
from sainet.models.identity import ModelId
from sainet.models.library import load_model
from sainet.runs.documents import write_document
from sainet.runs.errors import BadInput
from sainet.studies.recorded_trust import WithAbstaining
from sainet.studies.steps import Join

GROUPS = ("felt-10", "felt-20", "ice-10")
LENGTHS = np.resize([12, 5, 8], 12)
OF_GROUP = np.resize([2, 0, 1, 0], 12)
UNKNOWN = GROUPS.index("ice-10") == OF_GROUP


@pytest.mark.parametrize(
    ("group", "surface"),
    [
        ("abs-10", "abs"),
        ("abs-7.5", "abs"),
        ("hard-wood-20", "hard-wood"),
        ("hard-wood", "hard-wood"),
        ("felt", "felt"),
        ("abs10", "abs10"),
        ("-10", "-10"),
    ],
)
def test_a_surface_is_a_group_without_its_speed(group, surface):
    assert surface_of(group) == surface


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Pushes of three lengths on two surfaces, one of them at two speeds."""
    info = info_of(12, engine="recorded", seed=None, bodies=1, groups=GROUPS)
    arrays = end_points_alone(made_up(info, LENGTHS)) | {"group": OF_GROUP}
    return write(tmp_path_factory.mktemp("recorded") / "data", info, arrays)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """An engine that was identified on felt, at one speed."""
    folder = tmp_path_factory.mktemp("fitted") / "felt"
    identified_folder(folder, pusher_friction=0.7, camera_x_mm=1.0)
    found = structs.replace(read_identified(folder), groups=("felt-10",))
    write_document(folder / IDENTIFIED, found)
    return folder


@pytest.fixture(scope="module")
def fitted(folder):
    return load_model(str(folder))


@pytest.fixture(scope="module")
def physics():
    return load_model("physics")


@pytest.fixture(scope="module")
def measured(store, fitted, physics):
    models = with_abstaining([physics, fitted])
    return measure(models, store, lambda plain: evaluate(plain, store))


def same(one, other, where):
    """Whether two models have the very same measurements of some pushes."""
    return {
        np.array_equal(*(v[where] for v in values), equal_nan=True)
        for values in zip(one, other, strict=True)
    }


def test_pushes_of_known_surfaces_are_the_models_and_others_the_engines(measured):
    assert measured.slugs == ["physics", "felt", "felt-abstaining"]
    physics, model, both = (
        [measured.values(name, slug) for name in measured.error_names]
        for slug in measured.slugs
    )
    assert same(both, model, ~UNKNOWN) == {True}  # to the last bit
    assert same(both, physics, UNKNOWN) == {True}
    assert same(physics, model, UNKNOWN) == same(physics, model, ~UNKNOWN) == {False}


def test_an_abstaining_model_is_a_row_of_its_own(measured, fitted, physics):
    rows = {(row.condition, row.model) for row in summarise(measured).rows}
    assert ("ice-10", "felt-abstaining") in rows
    whole = ModelId(kind="gp", simulator=load_model("sain").id.simulator)
    assert whole.abstaining.slug == "gp-abstaining"
    assert whole.abstaining.label == "Gaussian process, abstaining"
    assert whole.abstaining != whole
    assert repr(whole) == repr(whole.abstaining).replace(", abstains=True", "")
    (form,) = abstaining([fitted], physics)
    assert form.called("mine").name == "mine"


def test_another_speed_is_no_reason_to_abstain(fitted, physics):
    (form,) = abstaining([fitted], physics)
    assert form.surfaces == ("felt",)
    assert form.on("felt") is form.on("felt-20") is fitted
    assert form.on("ice-10") is form.on("ice") is physics


class Bold(PhysicsDynamics):
    """Physics that claims to be exact."""

    @property
    def has_regions(self):
        return True

    def region(self, scene, state, controls):
        one = np.ones((len(scene.mass), 1), np.float32)
        return Region(
            axes=np.stack([one, one], axis=-1),
            heading=one[:, 0],
            turn=one,
            plain=np.stack([one, one], axis=-1),
        )


def test_no_coverage_is_claimed_where_a_model_abstains(store, fitted, physics):
    bold = replace(fitted, dynamics=Bold(physics.dynamics.engine))
    models = with_abstaining([physics, bold])
    found = measure(models, store, lambda plain: evaluate(plain, store))
    covered = {(each.model, each.condition) for each in coverage_of(found)}
    known = {("felt-abstaining", "felt-10"), ("felt-abstaining", "felt-20")}
    assert covered == known | {("felt", group) for group in GROUPS}
    whole = found.in_condition(Condition(label="all of them"))
    assert {each.model for each in coverage_of(whole)} == {"felt"}


def test_scripts_evaluate_abstaining_models(store, folder, measured):
    model = sn.load(folder)
    table = sn.evaluate({"mine": sn.abstaining(model), "as it is": model}, store.path)
    found = table.measured
    assert found.slugs == ["mine", "as it is"]  # the engine has no row
    for name, slug in (("mine", "felt-abstaining"), ("as it is", "felt")):
        for error in found.error_names:
            np.testing.assert_array_equal(
                found.values(error, name), measured.values(error, slug)
            )


def test_what_cannot_abstain_is_refused(store, fitted, physics, tmp_path):
    with pytest.raises(BadInput, match="physics: not known to be fitted .*'sainet"):
        sn.abstaining("physics")
    twins = abstaining([fitted], physics) * 2
    with pytest.raises(BadInput, match="not all different"):
        sn.evaluate(twins, store.path)
    info = structs.replace(store.info, groups=())
    arrays = store.read(slice(None)) | {"group": np.zeros(12)}
    nameless = write(tmp_path / "nameless", info, arrays)
    with pytest.raises(BadInput, match="its pushes name no group"):
        sn.evaluate(twins[:1], nameless.path)


def test_the_command_adds_rows_and_physics(store, folder, capsys):
    words = ["evaluate", "--data", str(store.path), "--json", "--quiet", "--abstain"]
    assert run([*words, "--model", str(folder)]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {r["model"] for r in rows} == {"physics", "felt", "felt-abstaining"}
    at = {(r["group"], r["model"]): r["final_pos_mm"] for r in rows}
    for group in GROUPS:
        source = "physics" if group == "ice-10" else "felt"
        assert at[group, "felt-abstaining"] == at[group, source]


def test_the_command_refuses_models_without_groups_in_one_line(store, capsys):
    words = ["evaluate", "--data", str(store.path), "--abstain", "--model"]
    assert run([*words, "physics", "sain-stroke"]) == 2
    error = capsys.readouterr().err.strip()
    assert error.count("\n") == 0
    assert "physics, sain-stroke: not known to be fitted to any surface" in error
    assert "'sainet tune'" in error


def test_a_study_adds_rows_only_where_models_abstain(measured):
    model = ModelId(kind="physics", name="felt")
    plain = measured.of_models(["physics", "felt"])
    step = WithAbstaining(Join(()), (model,), ("ice-10",))
    found = step.added_to(plain)
    assert found.slugs == ["physics", "felt", "felt-abstaining"]
    values = found.values("final_pos_mm", "felt-abstaining")
    wanted = measured.values("final_pos_mm", "physics")
    np.testing.assert_array_equal(values[UNKNOWN], wanted[UNKNOWN])
    assert np.isnan(values[~UNKNOWN]).all()
    summary = summarise(found, subject="felt")
    where = [e.condition for e in summary.rows if e.model == "felt-abstaining"]
    assert where == ["ice-10"]
    verdict = keeps_to_engine("felt-abstaining", "physics", share=0.03)(summary)
    assert verdict.status == "holds"
    assert {each.condition for each in verdict.comparisons} == {"ice-10"}
    assert not verdict.is_test
    doubted = keeps_to_engine("felt", "physics", share=-0.99)(summary)
    assert doubted.status == "does not hold"
    unknown = keeps_to_engine("none", "physics", share=0.03)(summary)
    assert unknown.status == "not testable here"
