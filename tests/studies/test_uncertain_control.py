"""Control that weighs uncertainty or adapts: what is compared with what, and a run."""

from dataclasses import replace
from importlib.util import find_spec

import pytest

from sainet.control.worlds import world_of
from sainet.studies import adaptation, expected_cost, load_study
from sainet.studies.adaptation import ON_ABS, THEN_PLYWOOD
from sainet.studies.study import Scope
from support import require

PAPER = Scope("paper", None)


def test_expected_costs_are_compared_with_costs_of_one_prediction():
    parts = load_study("expected-cost").plan(PAPER).measured.parts
    assert len({part.name for part in parts}) == len(parts)
    for usual, expected in zip(parts[::2], parts[1::2], strict=True):
        assert usual.models == expected.models
        assert not usual.config.expected_cost
        assert replace(usual.config, expected_cost=True) == expected.config
        assert expected.name == f"{usual.name}, expected cost"


def test_expected_costs_are_measured_where_they_should_matter():
    parts = load_study("expected-cost").plan(PAPER).measured.parts
    assert {part.config.property_error for part in parts} == {0, 0.05, 0.1}
    assert {part.config.planner for part in parts} == {"greedy", "tree"}
    assert {world_of(part.config) for part in parts} == {"bullet", "lab"}
    for part in parts:
        (process,) = part.models
        if part.config.property_error:  # an engine that ignores them cannot be wrong
            assert process.simulator.slug == "planar-true"
        if part.config.robot == "lab":
            assert process.identified.pushes is process.pushes
            assert process.pushes.pushes.config.lab == part.config.lab


def test_adaptation_is_tested_before_and_after_a_change_of_the_surface():
    plan = load_study("lab-adaptation").plan(PAPER).measured
    labs, trials, *_, before = adaptation.LAB_TRIALS["paper"]
    assert sorted(plan.labs) == sorted([*range(labs)] * 4)
    for lab, part in zip(plan.labs, plan.parts, strict=True):
        config = part.config
        assert (config.lab, config.seed, config.trials) == (lab, lab, trials)
        assert config.adapt == part.name.endswith(", adapted")
        after = before if THEN_PLYWOOD in part.name else None
        assert config.new_surface_after == after
        assert part.name.startswith(ON_ABS)


@pytest.mark.slow
def test_both_run(make, runner, monkeypatch):
    require(find_spec("mujoco"), "MuJoCo is not installed")
    monkeypatch.setattr(expected_cost, "PUSHES", {"quick": (16,)})
    monkeypatch.setattr(adaptation, "LAB_TRIALS", {"quick": (1, 1, 2, 1)})
    found = make("lab-adaptation")
    assert [row["trials"] for row in found["rows"]] == [1] * 4
    parts = load_study("expected-cost").plan(Scope("quick", None)).measured.parts
    for part in parts:
        if part.config.planner == "greedy":  # compiled faster than the tree
            assert runner.result(part).header.models == (part.models[0].id,)
    (process,) = parts[-1].models
    assert runner.result(process).id.slug == "gp-identified-angle"
