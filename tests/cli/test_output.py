"""What commands print stays as it is: paths are not markup, commands are not broken."""

from contextlib import contextmanager

import pytest

from sainet.cli.output import Bars, Output, progress_bar
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
