"""Ctrl-C ends a command even where Python or a library swallows the exception."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from sainet import cli
from sainet.cli import entry
from sainet.cli.datasets import Generate
from sainet.cli.evaluate import Evaluate
from sainet.cli.output import Output, progress_bar
from sainet.runs.interrupts import raise_if_interrupted, remembered_interrupts

pytestmark = pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnraisableExceptionWarning"
)


class Swallower:
    """Raises in its finaliser, where Python prints an exception and forgets it."""

    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)


def swallow():
    Swallower()


@pytest.fixture(autouse=True)
def _foreground():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(("swallowed_at", "steps"), [(3, 3), (10, 10)])
def test_a_swallowed_interrupt_ends_the_command(
    swallowed_at, steps, monkeypatch, capsys, tmp_path
):
    command = Generate(out=tmp_path, output=Output(quiet=True))
    done = []

    def run(self):
        with progress_bar("Simulating", 10, self.output) as advance:
            for step in range(1, 11):
                advance(1)
                done.append(step)
                if step == swallowed_at:
                    swallow()
        return {}

    monkeypatch.setattr(Generate, "run", run)
    monkeypatch.setattr(entry, "parse", lambda words: command)
    assert entry.run(["anything"]) == entry.INTERRUPTED
    assert len(done) == steps
    line = "sainet: interrupted; the same command resumes.\n"
    assert capsys.readouterr().err.endswith(line)


@pytest.mark.parametrize(("out", "verb"), [(None, "starts over"), ("x", "resumes")])
def test_an_evaluation_with_a_folder_resumes(out, verb, monkeypatch, capsys):
    command = Evaluate(data=Path("data"), out=out and Path(out))
    monkeypatch.setattr(
        Evaluate, "run", lambda self: signal.raise_signal(signal.SIGINT)
    )
    monkeypatch.setattr(entry, "parse", lambda words: command)
    assert entry.run(["anything"]) == entry.INTERRUPTED
    assert capsys.readouterr().err.endswith(f"the same command {verb}.\n")


def test_the_next_command_in_this_process_is_not_interrupted():
    with pytest.raises(KeyboardInterrupt), remembered_interrupts():
        swallow()
    raise_if_interrupted()


def test_a_command_that_has_ended_cannot_be_interrupted(monkeypatch):
    monkeypatch.setattr(entry, "run", lambda: 0)
    with pytest.raises(SystemExit) as ended:
        cli.main()
    os.kill(os.getpid(), signal.SIGINT)
    assert ended.value.code == 0


def test_background_jobs_keep_ignored_signals():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with remembered_interrupts():
        os.kill(os.getpid(), signal.SIGINT)
        raise_if_interrupted()


def test_ctrl_c_before_a_command_begins_is_one_line():
    code = (
        "import signal\nfrom sainet.cli import entry, main\n"
        "entry.parse = lambda words: signal.raise_signal(signal.SIGINT)\nmain()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert done.returncode == entry.INTERRUPTED
    assert done.stderr == "sainet: interrupted before it began.\n"


def test_ctrl_c_in_a_finaliser_is_not_printed(capsys):
    with pytest.raises(KeyboardInterrupt), remembered_interrupts():
        swallow()
    assert capsys.readouterr().err == ""
