"""The final output of `sainet control`, with fake episodes."""

import shlex

import pytest

from report.samples import record
from sainet.cli import control
from sainet.cli.control import Control
from sainet.control.config import ControlConfig


@pytest.fixture
def said(monkeypatch, tmp_path, capsys):
    """The output for a number of equal episodes."""

    def run(trials, **ends):
        records = [record(trial=trial, **ends) for trial in range(trials)]
        monkeypatch.setattr(
            "sainet.control.trials.run_trials", lambda *args, **settings: records
        )
        Control(
            config=ControlConfig(model="physics", trials=trials), out=tmp_path
        ).run()
        return capsys.readouterr().out

    return run


def test_control_prints_its_results(said):
    one = said(1, solved=False)
    assert "0 of 1 easy goals solved (95 % interval 0% to 79%).\n" in one
    assert "each drawn in" in one
    seven = said(7)
    assert "7 of 7 easy goals solved" in seven
    assert "with a median of 3 pushes.\n" in seven
    assert "the first 6 drawn in" in seven


def test_the_command_on_the_page_parses():
    odd = ControlConfig(model="runs/my net; ls", trials=3)
    words = shlex.split(control._command(odd))
    assert words[2:] == ["--model", "runs/my net; ls", "--trials", "3", "--animate"]
    swapped = ControlConfig(robot="lab", swapped=True)
    words = shlex.split(control._command(swapped))
    assert words[2:] == ["--robot", "lab", "--swapped", "--animate"]
