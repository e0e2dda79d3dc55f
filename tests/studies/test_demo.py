"""The demo from its first push to its report, which opens and plays in a browser."""

import html
import json
import shlex
import subprocess
import sys

import numpy as np
import pytest
from selenium.webdriver.support.ui import WebDriverWait

from report.test_report_browser import element, milliseconds, opened
from sainet.cli.demo import Demo
from sainet.cli.entry import run
from sainet.cli.output import Output
from sainet.cli.reproduce import Reproduce
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.evaluation.claims import Claim, Verdict
from sainet.evaluation.summary import Summary
from sainet.runs.errors import BadInput, BadStore, MissingExtra, UnknownName
from sainet.scenes.quantities import LARGEST_SEED
from sainet.studies import STUDIES, DemoConfig, load_study
from sainet.studies.demo import run_demo, typical_push
from sainet.studies.paper_tables import PUBLISHED_ROBOT_TWO_DISKS
from sainet.studies.runner import Runner
from sainet.studies.steps import Join
from sainet.studies.study import Plan, Result, Ruling, Study
from support import SOURCE

TINY = ("--pushes", "100", "--test-pushes", "6", "--iterations", "2")


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    out = tmp_path_factory.mktemp("demo") / "demo"
    command = [sys.executable, "-m", "sainet", "demo", *TINY, "--out", str(out)]
    done = subprocess.run(
        [*command, "--json", "--quiet"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return out, json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_the_demo_compares_four_models_on_both_disks(demo):
    out, result = demo
    rows = {(row["model"], row["body"]) for row in result["rows"]}
    models = ("physics", "physics-true", "in", "sain")
    assert rows == {(model, body) for model in models for body in (1, 2)}
    assert all(row["n"] == 6 for row in result["rows"])
    page = html.unescape((out / "report.html").read_text())
    assert "100 pushes for 2 iterations of the paper's 10,000" in page
    assert "nearest to the median of all 6 test pushes" in page
    assert shlex.join(["sainet", "demo", *TINY, "--out", str(out)]) in page


def test_the_largest_seed_has_test_pushes_of_another_seed(monkeypatch, tmp_path):
    seeds = []

    def result(runner, step):
        seeds.append(step.config.seed)
        if len(seeds) == 2:
            raise StopIteration

    monkeypatch.setattr(Runner, "result", result)
    runner = Runner(tmp_path)
    with pytest.raises(StopIteration):
        run_demo(DemoConfig(seed=LARGEST_SEED), tmp_path / "out", runner, print, "")
    assert seeds == [LARGEST_SEED, 0]


def test_a_demo_that_is_impossible_leaves_nothing(tmp_path, capsys):
    out = tmp_path / "demo"
    assert run(["demo", "--pushes", "0", "--out", str(out)]) == BadInput.exit_status
    assert "--pushes is 0" in capsys.readouterr().err
    assert not out.exists()


def test_the_page_of_the_demo_quotes_the_command_that_was_given(monkeypatch, tmp_path):
    def run_demo(config, out, runner, say, command):
        raise BadInput(command)

    monkeypatch.setattr("sainet.studies.demo.run_demo", run_demo)
    monkeypatch.setattr("sainet.cli.demo.use_devices", lambda count: None)
    config = DemoConfig(pushes=50, seed=3)
    with pytest.raises(BadInput, match=f"demo --pushes 50 --seed 3 --out {tmp_path}$"):
        Demo(config=config, out=tmp_path).run()


@pytest.mark.parametrize("wanted", range(5))
def test_the_shown_push_compares_as_most_pushes_do(wanted):
    """On each disk its share is near the median: not 0.4 and 0.1, for example."""
    shares = np.array([[0.1, 0.2], [0.2, 0.5], [0.3, 0.25], [0.4, 0.1], [2.0, 3.0]])
    shares = np.roll(shares, wanted, axis=0)
    assert typical_push(shares) == (2 + wanted) % 5


MODELS = ("SAIN", "Physics")


@pytest.mark.slow
@pytest.mark.browser
def test_the_report_of_the_demo_plays(demo, chromium):
    out, _ = demo
    with opened(chromium, out, "--force-prefers-reduced-motion") as driver:
        end = milliseconds(driver)
        element(driver, "play").click()
        WebDriverWait(driver, 20).until(lambda page: 0 < milliseconds(page) < end)
        cases = [(goals, model) for goals in ("easy", "hard") for model in MODELS]
        for block, (goals, model) in enumerate(cases):
            title = element(driver, "title", f"episode-{block}").text
            assert title.startswith(f"{model}, {goals} goal 1: ")
            assert model == "Physics" or "solved with " in title
        sentences = driver.find_elements("css selector", "#episodes > p")
        starts = [each.text.partition(":")[0] for each in sentences]
        assert starts[-2:] == ["Easy goal 1", "Hard goal 1"]


def test_an_unknown_study_lists_the_available_studies():
    with pytest.raises(UnknownName, match="robot-planar"):
        load_study("table-9")
    for name in STUDIES:
        assert load_study(name).question.endswith("?")


NOTHING = Result(summary=Summary(models=()))


@pytest.fixture
def begun(monkeypatch):
    """The folders of the studies that were run, which do nothing."""
    folders = []

    def run(self, name, scope, runner, out, *, command):
        assert command[:5] == ["sainet", "reproduce", name, "--scale", scope.scale]
        folders.append(out)
        return NOTHING

    monkeypatch.setattr(Study, "run", run)
    monkeypatch.setattr("sainet.cli.reproduce.use_devices", lambda count: None)
    return folders


@pytest.mark.parametrize(
    ("second", "error", "says"),
    [
        ("table-9", UnknownName, "table-9"),
        ("recorded-pushes", BadInput, "`recorded` is missing"),
        ("engine-parity", MissingExtra, "PyBullet"),
    ],
)
def test_missing_requirements_are_reported_before_any_run(
    second, error, says, begun, monkeypatch
):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(error, match=says):
        Reproduce(studies=("robot-planar", second)).run()
    assert begun == []


def test_skipped_studies_are_reported_even_when_quiet(begun, monkeypatch, capsys):
    for package in ("pybullet", "mujoco"):
        monkeypatch.setitem(sys.modules, package, None)
    found = json.loads(json.dumps(Reproduce(output=Output(quiet=True)).run()))
    not_run = found["not_run"]
    assert found["studies"].keys() == {"robot-planar", "fine-tuning"}
    folders = [folder.name for folder in begun]
    assert folders == ["robot-planar-quick", "fine-tuning-quick"]
    lines = capsys.readouterr().err.splitlines()
    assert {line.partition(" is not run: ")[0] for line in lines} == not_run.keys()
    assert not_run.keys() == set(STUDIES) - {"robot-planar", "fine-tuning"}
    assert not_run["recorded-pushes"].startswith("--recorded is missing: give")
    assert "PyBullet" in not_run["engine-parity"]
    assert "sainet[mujoco]" in not_run["lab-control"]


def test_the_origin_of_measurements_names_every_option_that_changes_them(
    monkeypatch, tmp_path
):
    commands = []

    def run(self, name, scope, runner, out, *, command):
        commands.append(" ".join(command))
        return NOTHING

    monkeypatch.setattr(Study, "run", run)
    monkeypatch.setattr("sainet.cli.reproduce.use_devices", lambda count: None)
    Reproduce(studies=("robot-planar",), trainings=1, out=tmp_path).run()
    assert commands == ["sainet reproduce robot-planar --scale quick --trainings 1"]


def test_simulated_pushes_are_not_taken_for_recorded_ones(begun, tmp_path):
    made = generate(GenerateConfig(pushes=2, chunk_size=2, disks=1), tmp_path / "made")
    with pytest.raises(BadStore, match="simulated; `recorded` takes"):
        Reproduce(studies=("recorded-pushes",), recorded=made.path).run()
    assert begun == []


def test_claims_are_printed_and_in_the_json(monkeypatch, capsys, tmp_path):
    ruled = Result(
        summary=Summary(models=()), claims=(Ruling("the sky is blue", "holds"),)
    )
    claim = Claim("the sky is blue", lambda summary: Verdict("holds"))
    plan = Plan(Join(()))
    study = Study(question="Is it?", plan=lambda scope: plan, needs=(), claims=(claim,))
    monkeypatch.setattr("sainet.studies.load_study", lambda name: study)
    monkeypatch.setattr(Study, "run", lambda *inputs, command: ruled)
    monkeypatch.setattr("sainet.cli.reproduce.use_devices", lambda count: None)
    found = Reproduce(studies=("robot-planar",), out=tmp_path).run()
    assert [*found["claims"]] == [{"claim": "the sky is blue", "status": "holds"}]
    assert "Claim: the sky is blue. Verdict: holds." in capsys.readouterr().out


def test_every_claim_is_a_sentence_that_a_summary_can_test():
    studies = [load_study(name) for name in STUDIES]
    claims = [claim for study in studies for claim in study.claims]
    assert len(claims) > len({claim.text for claim in claims}) > 5
    for claim in claims:
        assert claim.rule(Summary(models=())).status == "not testable here"


def test_parallel_training_is_refused_on_one_gpu(begun, monkeypatch):
    monkeypatch.setattr("jax.default_backend", lambda: "gpu")
    with pytest.raises(BadInput, match="--at-once is 2; on a GPU it must be 1"):
        Reproduce(studies=("robot-planar",), at_once=2).run()
    assert begun == []
    Reproduce(studies=("robot-planar",)).run()
    assert [folder.name for folder in begun] == ["robot-planar-quick"]


def test_the_help_names_every_study():
    source = (SOURCE / "cli" / "reproduce.py").read_text("utf-8")
    assert all(name in source for name in STUDIES)


def test_published_values_are_the_papers():
    (sain,) = (each for each in PUBLISHED_ROBOT_TWO_DISKS if each.model.slug == "sain")
    second = {metric: values[1] for metric, values in sain.values.items()}
    assert second == {"trans_percent": 1.50, "pos_mm": 3.47, "rot_deg": 0.21}
