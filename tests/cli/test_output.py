"""What commands print stays as it is: paths are not markup, commands are not broken."""

import pytest

from sainet.cli.output import Output, Pace, progress_bar

PATH = "runs/[test]/[/test]/" + "a" * 80


def test_a_path_is_printed_unchanged_on_one_line(capsys):
    Output().say(f"Open {PATH} in a browser.")
    assert capsys.readouterr().out == f"Open {PATH} in a browser.\n"
    Output(json=True).say(PATH)
    assert capsys.readouterr() == ("", f"{PATH}\n")
    Output().say("[bold]1[/] Simulating.", markup=True)
    assert capsys.readouterr().out == "1 Simulating.\n"


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
