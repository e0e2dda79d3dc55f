"""The control table, tiny: every model on the same goals, each episode once."""

from dataclasses import replace

import pytest
from rich.console import Console

from sainet.engines.simulator import SIMULATORS
from sainet.evaluation.measurements import Condition
from sainet.evaluation.summary import Summary
from sainet.evaluation.trials import TrialRow, TrialTest
from sainet.models.identity import ModelId
from sainet.report.arrange import arrange
from sainet.report.writers import print_table, to_markdown
from sainet.runs.documents import read_json
from sainet.studies import load_study, simulated_control
from sainet.studies.paper_setup import IN, SAIN
from sainet.studies.simulated_control import MODELS, PUBLISHED_SIMULATED_CONTROL, trials
from sainet.studies.study import Scope


def test_the_trials_include_those_of_the_paper():
    found = {each.name: each.config for each in trials(100, 60)}
    assert all(config.world == "bullet" for config in found.values())
    sizes = [config.trials for config in found.values()]
    assert sizes == [100] * 4 + [50]
    assert found["hard, tree, nominal properties"].given_properties == "assumed"
    assert all(config.disks == 2 for config in found.values())
    assert len({tuple(vars(config).items()) for config in found.values()}) == 5


ALL = ("physics", "physics-true", "sain", "sain-any")
LONG = ("physics", "physics-true", "sain-any")


@pytest.mark.parametrize(
    ("scale", "rows"),
    [
        ("quick", {2: (1, ALL), 3: (1, ALL)}),
        ("paper", {2: (100, ALL), 3: (50, ALL), 4: (50, LONG), 5: (50, LONG)}),
    ],
)
def test_longer_rows_have_fewer_goals_and_the_longest_fewer_models(scale, rows):
    parts = load_study("control-any-number").plan(Scope(scale)).measured.parts
    usual = (part for part in parts if not part.config.adapt)
    assert {
        part.config.disks: (part.config.trials, tuple(m.id.slug for m in part.models))
        for part in usual
    } == rows
    adapted = [part for part in parts if part.config.adapt]
    assert [part.config.disks for part in adapted] == [n for n in rows if n > 3]
    assert {m.id.slug for part in adapted for m in part.models} <= {"physics"}


@pytest.mark.slow
def test_all_models_have_the_same_goals(make, tmp_path, monkeypatch):
    (usual, *_) = trials(2, 60)
    small = replace(usual.config, world="planar", pushes=1)
    few = replace(usual, config=small, models=MODELS[:2])
    monkeypatch.setattr(simulated_control, "trials", lambda *size: [few])
    table = make("simulated-control")
    assert [row["model"] for row in table["rows"]] == ["physics", "physics-true"]
    assert [row["trials"] for row in table["rows"]] == [2, 2]
    pairs = {pair["measure"]: pair for pair in table["pairs"]}
    assert tuple(pairs) == ("solved", "within_4_mm", "within_25_pushes")
    for pair in pairs.values():
        assert (pair["only_one"], pair["only_other"], pair["p"]) == (0, 0, 1.0)
    goals = [
        read_json(path)["goal_mm"] for path in sorted(tmp_path.rglob("episodes/*.json"))
    ]
    assert goals[:2] == goals[2:]
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("0*.json")}
    make("simulated-control")
    assert {path: path.stat().st_mtime_ns for path in before} == before


def row(model, **changes):
    known = {
        "condition": "hard, tree",
        "model": model,
        "trials": 100,
        "solved": 98,
        "success": 0.98,
        "interval": (0.93, 0.994),
        "median_pushes": 24.5,
        "within_25_pushes": 0.61,
        "within_4_mm": 0.5,
        "median_final_mm": 3.0,
        "median_decision_s": 0.4149,
        "ended_early": 1,
    }
    return TrialRow(**known | changes)


def compared(measure, p):
    names = {"condition": "hard, tree", "model": "sain", "against": "in"}
    return TrialTest(**names, measure=measure, only_one=6, only_other=1, p=p)


def result():
    none = {"solved": 0, "success": 0.0, "median_pushes": None, "ended_early": 0}
    return Summary(
        models=(SAIN, IN),
        conditions=(Condition(label="hard, tree"),),
        trials=(row("sain"), row("in", **none)),
        tests=(
            compared("solved", 0.125),
            compared("within_4_mm", 0.125),
            compared("within_25_pushes", 0.031),
        ),
        published=(PUBLISHED_SIMULATED_CONTROL[1],),
    )


def test_the_control_table_has_every_result_once():
    console = Console(record=True, width=140, file=None)
    with console.capture() as capture:
        print_table(arrange(result()), console)
    text = capture.get()
    for part in ("98/100", "93%–99%", "24.5", "61%", "0.415", "22/25", "published"):  # noqa: RUF001
        assert part in text
    told = "only SAIN 6, only IN 1 (exact McNemar p = "
    assert f"hard, tree, solved: {told}0.12)" in text
    assert f"hard, tree, within 25 pushes: {told}0.031)" in text
    assert "within 4 mm: " not in text  # may be chance
    assert "SAIN: 1 of 2 unsolved trials ended because the measured pose" in text
    lines = to_markdown(arrange(result())).splitlines()
    assert {line.count("|") for line in lines if line.startswith("|")} == {9}
    assert "| hard, tree | IN | 0/100 |" in lines[3]


def test_a_narrow_terminal_shows_long_names_whole():
    label = "50 pushes of a virtual lab, expected cost"
    simulator = SIMULATORS["planar-true"]
    known = ModelId(kind="gp", simulator=simulator, features="angle")
    long = row(known.slug, condition=label)
    found = Summary(
        models=(known,), conditions=(Condition(label=label),), trials=(long,)
    )
    console = Console(width=80, file=None)
    with console.capture() as capture:
        print_table(arrange(found), console)
    words = capture.get().split()
    assert max(map(len, capture.get().splitlines())) <= 80
    for word in (*label.split(), *known.label.split(), "98/100", "93%–99%", "61%"):  # noqa: RUF001
        assert word in words
