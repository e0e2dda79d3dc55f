"""Errors of the library become one line of the command line, with its options."""

import pickle

import pytest

from sainet.cli.datasets import Generate
from sainet.cli.entry import run
from sainet.cli.help import message
from sainet.cli.train import Train
from sainet.runs.errors import BadInput, BadSetting, unknown_name


def test_settings_become_options_of_the_command():
    error = BadSetting("chunk_size", 0, "at least 1")
    assert str(error) == "`chunk_size` is 0; it must be at least 1."
    assert message(error, Generate) == "--chunk-size is 0; it must be at least 1."
    nested = BadInput("reduce `tracking_mm` or choose another `out`")
    assert message(nested, Generate) == "reduce --tracking-mm or choose another --out"


@pytest.mark.parametrize("name", ["iterations", "learning_rate", "hold", "patience"])
def test_settings_of_recipes_become_options(name):
    flag = f"--{name.replace('_', '-')}"
    assert message(BadSetting(name, 0, "good"), Train).startswith(f"{flag} is 0")


def test_what_is_no_option_stays_a_name():
    error = BadInput("`model` and `chunk_size` are wrong")  # `model` is positional
    assert message(error, Train) == str(error)
    assert message(error) == str(error)


def test_settings_cross_processes():
    error = pickle.loads(pickle.dumps(BadSetting("pushes", 0, "at least 1")))
    assert str(error) == "`pushes` is 0; it must be at least 1."


@pytest.mark.parametrize(
    "text", ["x" * 5000, "a\nb\tc", "\ud800", "\x1b[31m", "[" * 999]
)
def test_any_message_is_printable_and_short(text):
    shown = message(BadInput(f"file: {text}; remedy"))
    assert all(line.isprintable() and len(line) <= 300 for line in shown.splitlines())
    assert shown.startswith("file: ") and shown.endswith("remedy")


def test_unknown_names_suggest_the_nearest():
    error = unknown_name("model", "saim", ["in", "sain"])
    assert str(error) == (
        "No model named 'saim' (did you mean sain?). Available: in, sain."
    )


@pytest.mark.parametrize(
    ("word", "nearest"),
    [("paly", "play"), ("evalute", "evaluate"), ("PLAY", "play"), ("xyz", None)],
)
def test_an_unknown_command_suggests_the_nearest(word, nearest, capsys):
    assert run([word, "--data", "x"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    hint = f" (did you mean {nearest}?)" if nearest else ""
    assert line.startswith(f"sainet: No command named '{word}'{hint}. Available: ")
