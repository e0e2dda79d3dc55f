"""A small seed set of the mutated inputs; `python tests/fuzz.py` runs thousands."""

import subprocess
import sys
from pathlib import Path

FUZZ = Path(__file__).with_name("fuzz.py")


def test_damaged_inputs_are_refused_in_one_line():
    command = [sys.executable, str(FUZZ), "--cases", "80", "--seed", "26"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "80 cases" in done.stdout


def test_an_accepted_impossible_value_is_a_failure():
    """The script itself must be able to fail."""
    script = """
import sys
import fuzz
from sainet.datasets import store
store.check_values = lambda *arguments: None
counts = fuzz.run(range(0, 300, len(fuzz.TARGETS)), 0)
sys.exit(not any(how == "IMPOSSIBLE" for _, how in counts))
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=FUZZ.parent
    )
    assert done.returncode == 0, done.stdout + done.stderr
