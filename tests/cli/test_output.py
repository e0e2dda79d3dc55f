"""What commands print stays as it is: paths are not markup, commands are not broken."""

import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from sainet.cli.output import Bars, Output, progress_bar
from sainet.runs.errors import BadInput
from sainet.runs.progress import Pace
from sainet.studies.runner import Progress

PATH = "runs/[test]/[/test]/" + "a" * 80


def test_a_path_is_printed_unchanged_on_one_line(capsys):
    Output().say(f"Open {PATH} in a browser.")
    assert capsys.readouterr().out == f"Open {PATH} in a browser.\n"
    Output(json=True).say(PATH)
    assert capsys.readouterr() == ("", f"{PATH}\n")


def test_quiet_prints_only_warnings(capsys):
    output = Output(quiet=True)
    output.say("Going on ...")
    output.warn("Left out: [in].")
    assert capsys.readouterr() == ("", "Left out: [in].\n")


@pytest.mark.parametrize("name", ["[sain]", "[/sain]"])
def test_a_progress_bar_prints_names_unchanged(name, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    with progress_bar(f"Pushing ({name})", 2, Output()) as advance:
        advance(2, f"{name} solved")
    shown = capsys.readouterr().err
    assert f"Pushing ({name})" in shown
    assert f"{name} solved" in shown


def test_the_rate_is_that_after_the_first_units(monkeypatch):
    now = iter([70.0, 72.0, 74.0])  # s; compilation takes 70 s
    monkeypatch.setattr("time.perf_counter", lambda: next(now))
    pace = Pace()
    assert pace.add(1) is None
    assert pace.add(10) == 5.0
    assert pace.add(10) == 5.0


def test_before_the_first_unit_the_bar_shows_compiling(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    with (
        pytest.raises(KeyboardInterrupt),
        progress_bar("Training", 2, Output()) as advance,
    ):
        advance(0)
        raise KeyboardInterrupt
    shown = capsys.readouterr().err
    assert "compiling" in shown
    assert "0/2" not in shown


@pytest.mark.parametrize("done", [0, 1])
def test_a_bar_stays_only_if_something_was_done_before_an_error(done, capsys):
    with (
        pytest.raises(BadInput),
        progress_bar("Training", 2, Output()) as advance,
    ):
        advance(done)
        raise BadInput("no simulator prediction")
    assert ("Training" in capsys.readouterr().err) == bool(done)


@pytest.mark.parametrize("amounts", [(), (2,), (1, 1)])
def test_a_finished_bar_is_full_and_compiles_no_more(amounts, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    with progress_bar("Training", 2, Output()) as advance:
        for amount in amounts:
            advance(amount)
    shown = capsys.readouterr().err
    assert "2/2" in shown
    assert "compiling" not in shown


def test_each_step_has_a_bar_of_its_own_that_counts_to_its_end(monkeypatch):
    seen = []

    @contextmanager
    def bar(title, total, output):
        done = [0]

        def advance(amount, note=""):
            done[0] += amount

        try:
            yield advance
        finally:
            seen.append((title, total, *done))

    monkeypatch.setattr("sainet.cli.output.progress_bar", bar)
    with Bars(Output(quiet=True)) as bars:
        for title in ("Simulating", "Training"):
            for done in (0, 2, 5):
                bars(Progress(title, done, 5))
            bars(Progress(title, 5, 5, has_ended=True))
        bars(Progress("Predicting", 1, 3))
    assert seen == [("Simulating", 5, 5), ("Training", 5, 5), ("Predicting", 3, 1)]


def called(*words, out=subprocess.PIPE, **environment):
    """The end of a process of its own: sainet with these words."""
    return subprocess.run(
        [sys.executable, "-m", "sainet", *words],
        stdout=out,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        env={**os.environ, **environment},
    )


def test_a_terminal_without_some_characters_shows_others():
    done = called("--help", PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert (done.returncode, done.stderr) == (0, "")
    assert "? demo" in done.stdout  # instead of a bullet


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize("options", [[], ["--json"]])
def test_output_to_a_full_disk_ends_in_one_line(options, tmp_path):
    (tmp_path / "config.json").write_text('{"command": "demo"}')
    (tmp_path / "report.html").write_text("")
    with open("/dev/full", "w") as full:
        done = called("report", str(tmp_path), *options, out=full)
    assert done.returncode == 2
    text = "output: the disk is full; make room, or write to another.\n"
    assert done.stderr.endswith(text)
    assert done.stderr.count("\n") == 1 + bool(options)
