"""The final output of `sainet control`, with fake episodes."""

import shlex
from pathlib import Path

import pytest

from report.samples import record
from sainet.cli.control import Control
from sainet.cli.entry import run as called
from sainet.cli.output import command_of
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
    out, given = Path("my runs"), ["--out", "my runs", "--animate"]
    more = {"out": out, "animate": True}
    odd = ControlConfig(model="runs/my net; ls", trials=3)
    words = shlex.split(command_of("control", odd, **more))
    assert words[2:] == ["--model", "runs/my net; ls", "--trials", "3", *given]
    swapped = ControlConfig(robot="lab", swapped=True)
    words = shlex.split(command_of("control", swapped, **more))
    assert words[2:] == ["--robot", "lab", "--swapped", *given]


@pytest.mark.parametrize(
    ("words", "where"),
    [
        ("control --surface plywood", "--robot is lab"),
        ("control --lab 2", "--robot is lab"),
        ("control --area-mm 200", "--robot is lab or abb"),
        ("control --robot lab --world bullet", "--robot is simulated"),
        ("control --robot lab --noise-level none", "--robot is simulated"),
        ("record --surface plywood", "--robot is lab"),
        ("record --model physics", "--planner is given"),
        ("record --goals easy", "--planner is given"),
    ],
)
def test_a_setting_without_effect_is_refused(words, where, tmp_path, capsys):
    out = tmp_path / "out"
    assert called([*words.split(), "--out", str(out)]) == 2
    name, value = words.split()[-2:]
    value = f"{float(value)}" if name == "--area-mm" else value
    text = f"sainet: {name} is {value}; it must be left out unless {where}.\n"
    assert capsys.readouterr().err == text
    assert not out.exists()


def test_the_lab_is_a_robot_and_no_world(tmp_path, capsys):
    out = tmp_path / "out"
    assert called(["control", "--world", "lab", "--out", str(out)]) == 2
    assert capsys.readouterr().err == (
        "sainet: --world is lab; it must be planar or bullet; --robot selects the "
        "virtual lab.\n"
    )
    assert not out.exists()


def test_a_film_of_a_shard_is_refused(tmp_path, capsys):
    words = ["control", "--shard", "1/2", "--animate", "--out", str(tmp_path / "out")]
    assert called(words) == 2
    said = "sainet: --animate is True; it must be left out with a shard.\n"
    assert capsys.readouterr().err == said
    assert not (tmp_path / "out").exists()
