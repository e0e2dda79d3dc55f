"""The commands as a user types them: exit statuses, error lines, JSON at the end."""

import json
import os
import re
import shutil
import subprocess
import sys
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import pytest

from sainet import __version__
from sainet.cli import entry
from sainet.cli.bench import Bench
from sainet.cli.datasets import Generate
from support import SOURCE, write_sealed

SMALL = ["--pushes", "24", "--chunk-size", "12", "--workers", "1", "--quiet"]
# Runs one command after another in one process: its start and what it compiles take
# longer than most commands.
SHELL = """
import contextlib, io, json, logging, os, sys
from sainet.cli.devices import use_devices
from sainet.cli.entry import run
use_devices()  # once: JAX takes no other number later
for line in sys.stdin:
    folder, words = json.loads(line)
    os.chdir(folder)
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        try:
            status = run(words)
        except SystemExit as stop:
            status = stop.code
    logging.root.handlers.clear()
    print(json.dumps([status, out.getvalue(), error.getvalue()]), flush=True)
"""


class Done(NamedTuple):
    """The end of a command."""

    status: int
    stdout: str
    stderr: str


@lru_cache
def shell():
    """The process that runs commands; it ends with its standard input."""
    command = [sys.executable, "-c", SHELL]
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


def sainet(*words, status=0):
    process = shell()
    process.stdin.write(json.dumps([os.getcwd(), [*map(str, words)]]) + "\n")
    process.stdin.flush()
    done = Done(*json.loads(process.stdout.readline()))
    assert done.status == status, done.stderr
    return done


def sainet_alone(*words, **environment):
    """Runs a command in a process of its own, as a shell does."""
    command = [sys.executable, "-m", "sainet", *map(str, words)]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | environment,
    )
    assert done.returncode == 0, done.stderr
    return done


def test_version():
    assert sainet_alone("--version").stdout == f"sainet {__version__}\n"


def test_without_arguments_the_help_is_printed():
    shown = sainet_alone().stdout
    for name in ("demo", "generate", "import", "train", "evaluate", "reproduce"):
        assert name in shown


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("generate", "robot", "--pushes", "0"), ("--pushes", "at least 1")),
        (("generate", "robot", "--radius-mm", "-1"), ("--radius-mm", "from 1")),
        (("generate", "robot", "--mass-kg", "nan"), ("--mass-kg", "nan")),
        (("generate", "robot", "--gap-mm", "-9"), ("--gap-mm", "from -5")),
        (("generate", "robot", "--workers", "0"), ("--workers", "at least 1")),
        (("generate", "robot", "--disks", "1000000"), ("--disks", "from 1 to 100")),
        (("generate", "robot", "--engine", "planer"), ("--engine", "mean planar?")),
        (("reproduce", "--at-once", "0"), ("--at-once", "at least 1")),
    ],
)
def test_bad_settings_are_named_without_output(tmp_path, words, names):
    out = tmp_path / "out"
    error = sainet(*words, "--out", out, status=2).stderr
    assert error.startswith("sainet: ")
    assert len(error.splitlines()) == 1
    assert all(name in error for name in names)
    assert not out.exists()


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("train", "sain", "--data", "nowhere", "--out", "x"), ("nowhere", "generate")),
        (("evaluate", "--data", "nowhere"), ("nowhere", "generate")),
        (("import", "mitpush-endpoints", "no.csv", "--out", "x"), ("no.csv",)),
        (("reproduce", "no-such-table"), ("no-such-table", "robot-planar")),
        (("bench", "no-such-case"), ("no-such-case", "training")),
        (("report", "no-such-folder"), ("no-such-folder", "sainet made")),
    ],
)
def test_missing_inputs_are_named(tmp_path, monkeypatch, words, names):
    monkeypatch.chdir(tmp_path)
    error = sainet(*words, status=2).stderr
    assert "Traceback" not in error
    assert all(name in error for name in names)
    assert not list(tmp_path.glob("x"))


@pytest.mark.parametrize(
    "words",
    [
        ("report", "{}"),
        ("import", "table", "{}.csv", "--properties", "{}", "--out", "x"),
    ],
)
def test_an_impossible_path_gives_one_line(words):
    path = "x" * 300
    error = sainet(*(word.format(path) for word in words), status=2).stderr
    assert error.startswith("sainet: xxx")
    assert len(error.splitlines()) == 1
    assert len(error) < 320
    assert "File name too long" in error


def test_an_unknown_command_is_a_usage_error():
    sainet("fly", status=2)


@pytest.mark.parametrize(
    ("command", "verb"),
    [(Generate(out=Path("x")), "resumes"), (Bench(), "starts over")],
)
def test_an_interruption_names_the_command_that_resumes(
    command, verb, monkeypatch, capsys
):
    def stop(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(type(command), "run", stop)
    monkeypatch.setattr(entry, "parse", lambda words: command)
    assert entry.run(["anything"]) == entry.INTERRUPTED
    assert capsys.readouterr().err == f"sainet: interrupted; the same command {verb}.\n"


@pytest.fixture(scope="module")
def pushes(tmp_path_factory):
    out = tmp_path_factory.mktemp("cli") / "pushes"
    done = sainet("generate", "robot", *SMALL, "--out", out, "--json")
    assert json.loads(done.stdout.splitlines()[-1]) == {"out": str(out), "pushes": 24}
    return out


def test_what_a_command_compiles_is_kept(tmp_path):
    cache = tmp_path / "cache"
    keep = {"JAX_COMPILATION_CACHE_DIR": str(cache)}
    keep["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
    words = ("generate", "robot", "--pushes", 1, "--stroke-mm", 2, "--hold-steps", 1)
    sainet_alone(*words, "--workers", 1, "--quiet", "--out", tmp_path / "x", **keep)
    assert list(cache.rglob("*-cache"))


def test_equal_settings_do_nothing_and_others_are_refused(pushes):
    before = {p: p.stat().st_mtime_ns for p in pushes.rglob("*")}
    sainet("generate", "robot", *SMALL, "--out", pushes)
    other = [*SMALL[:1], "25", *SMALL[2:]]
    error = sainet("generate", "robot", *other, "--out", pushes, status=2).stderr
    assert "pushes is 24, not 25" in error
    assert {p: p.stat().st_mtime_ns for p in pushes.rglob("*")} == before


@pytest.mark.slow
def test_train_and_evaluate(pushes, tmp_path):
    out = tmp_path / "net"
    few = ("--iterations", 2, "--batch-size", 4, "--steps", 10, "--quiet", "--json")
    done = sainet("train", "sain", "--data", pushes, "--out", out, *few)
    assert json.loads(done.stdout)["model"] == "sain"
    assert (out / "learning-curve.svg").stat().st_size > 0
    words = ("--model", "physics", out, "--data", pushes, "--json", "--quiet")
    error = sainet("evaluate", *words, status=2).stderr
    assert f"{out}/card.json: the network was trained on " in error
    assert len(error.splitlines()) == 1
    result = json.loads(sainet("evaluate", *words, "--force").stdout)
    assert {row["model"] for row in result["rows"]} == {"physics", "net"}
    row = result["rows"][0]
    assert row["n"] == 24
    for name in ("trans_percent", "pos_mm", "rot_deg", "final_pos_mm", "final_rot_deg"):
        low, high = row[name + "_interval"]
        assert low <= row[name] <= high


def test_shipped_networks_are_compared_where_they_fit(pushes):
    words = ("evaluate", "--data", pushes, "--steps", 5, "--json", "--quiet")
    done = sainet(*words)
    assert {row["model"] for row in json.loads(done.stdout)["rows"]} == {
        "physics",
        "physics-true",
    }
    # These pushes have the seed of those that the shipped ones were trained on.
    for name in ("in", "sain"):
        assert f"Left out: {name}." in done.stderr
    words = ("evaluate", "--model", "sain", "--engine", "bullet", "--data", pushes)
    error = sainet(*words, status=2).stderr
    assert "internal engine is 'planar', not 'bullet'" in error
    assert len(error.splitlines()) == 1


@pytest.mark.slow
def test_control(tmp_path):
    out = tmp_path / "out"
    words = ("control", "--model", "physics", "--trials", 2, "--pushes", 1)
    words += ("--goals", "hard", "--animate", "--out", out, "--json", "--quiet")
    done = sainet_alone(*words)
    result = json.loads(done.stdout.splitlines()[-1])
    named = {name: result[name] for name in ("model", "goals", "planner", "world")}
    assert list(named.values()) == ["physics", "hard", "greedy", "planar"]
    assert (result["trials"], result["solved"], result["success"]) == (2, 0, 0.0)
    low, high = result["interval"]
    assert low == 0.0 < high < 1
    names = {"median_pushes", "median_decision_s", "within_4_mm", "episodes"}
    assert names <= result.keys()
    assert len(list(Path(result["episodes"]).glob("*.json"))) == 2
    for name in ("episodes.svg", "episode-000.mp4", "replay.html"):
        assert (out / name).stat().st_size > 0
    command = "sainet control --model physics --goals hard --trials 2 --pushes 1"
    assert f"{command} --out {out} --animate" in (out / "replay.html").read_text()
    done = sainet("report", out, "--json")
    assert json.loads(done.stdout) == {"report": str(out / "report.html")}
    assert "Pushing to a goal" in (out / "report.html").read_text()
    error = sainet("control", "--model", "no", "--out", tmp_path / "x", status=2).stderr
    assert error.startswith("sainet: No model named 'no'")
    assert not (tmp_path / "x").exists()


def shown(*words):
    return " ".join(sainet(*words, "--help").stdout.replace("│", " ").split())


def test_train_and_tune_show_the_settings_of_their_recipes():
    assert "Gradient steps. (default: 10000)" in shown("train", "in")
    assert "1,200 from the engine, 300 from a network" in shown("tune", "in")
    assert "to train a network further, use 'sainet tune'" in shown("train")


def test_a_network_is_tuned_and_an_engine_identified(pushes, tmp_path):
    few = ("--iterations", 2, "--batch-size", 4, "--steps", 5, "--quiet", "--json")
    words = ("tune", "in", "--start", "in", "--data", pushes)
    done = sainet(*words, "--out", tmp_path / "tuned", *few)
    assert json.loads(done.stdout.splitlines()[-1])["model"] == "in"
    card = json.loads((tmp_path / "tuned/card.json").read_text())
    assert card["started_from"]
    assert card["recipe"]["l2"] == 1e-3
    words = ("identify", "--data", pushes, "--out", tmp_path / "mine")
    found = sainet(*words, "--json")
    estimates = json.loads(found.stdout.splitlines()[-1])["estimates"]
    assert [e["name"] for e in estimates][0] == "pusher_friction"
    assert f"physics-true {tmp_path / 'mine'} --data TEST" in found.stderr
    error = sainet(*words, "--group", "ice", status=2).stderr
    assert "no group 'ice'; it has none" in error


def test_a_gaussian_process_is_fitted_and_evaluated(pushes, tmp_path):
    out = tmp_path / "gp"
    words = ("tune", "gp", "--data", pushes, "--engine", "planar", "--out", out)
    done = sainet(*words, "--iterations", 2, "--choose", "--json")
    assert json.loads(done.stdout.splitlines()[-1])["model"] == "gp"
    assert re.search("Chosen: features (angle|side), kernel [a-z]+", done.stderr)
    error = sainet("evaluate", "--model", out, "--data", pushes, status=2).stderr
    assert "trained on" in error
    given = ("--model", "physics", out, "--data", pushes, "--force", "--json")
    page = tmp_path / "page.html"
    done = sainet("evaluate", *given, "--page", page)
    assert "its 90 % regions hold" in done.stderr
    assert "An ellipse is where its model expects" in page.read_text()
    error = sainet("evaluate", *given, "--page", "page.pdf", status=2).stderr
    assert "--page" in error
    assert ".html" in error
    found = json.loads(done.stdout.splitlines()[-1])["coverage"]
    assert {each["model"] for each in found} == {"gp"}
    error = sainet(*words, "--hold", 3, status=2).stderr
    assert "--hold is 3; it must be left out: it is a setting of networks" in error
    error = sainet(*words, "--start", "sain", status=2).stderr
    assert "--start is sain; it must be left out: it is a setting of networks" in error
    words = ("tune", "sain", "--data", pushes, "--out", tmp_path / "net")
    error = sainet(*words, "--features", "side", status=2).stderr
    assert "--features is side; it must be paper, place or contact for a" in error
    error = sainet(*words, "--choose", status=2).stderr
    assert "--choose is True; it must be left out: it is a setting of gp" in error


def test_a_network_of_another_time_step_is_refused(pushes, tmp_path):
    out = tmp_path / "net"
    shutil.copytree(SOURCE / "models" / "pretrained" / "in", out)
    card = json.loads((out / "card.json").read_text())
    write_sealed(out / "card.json", card | {"time_step": 0.01})
    error = sainet("evaluate", "--model", out, "--data", pushes, status=2).stderr
    assert f"{out}/card.json: time_step is 0.01 s" in error
    assert "--force" in error
