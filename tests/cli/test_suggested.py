"""Commands that other commands suggest: they parse, and keep what was given."""

import shlex
from pathlib import Path

import pytest

from sainet.cli.cross_validate import CrossValidate
from sainet.cli.entry import parse
from sainet.cli.reproduce import Reproduce
from sainet.models.identity import ModelId
from sainet.studies.cross_validation import PHYSICS_IDENTIFIED

DATA = Path("runs/my pushes; ls")
MODELS = [
    ModelId(kind="physics"),
    PHYSICS_IDENTIFIED,
    ModelId(kind="gp", features="place"),
    ModelId(kind="sain", features="place"),
]


@pytest.mark.parametrize("group", [None, "abs 10"])
@pytest.mark.parametrize("model", MODELS)
def test_cross_validation_suggests_a_command_for_the_same_pushes(model, group):
    (text,) = CrossValidate(data=DATA, group=group)._commands(model, {"abs": 9})
    for part in text.split(" && "):
        command = parse(shlex.split(part)[1:])
        data = command.data if isinstance(command.data, tuple) else (command.data,)
        assert (data, command.group) == ((DATA,), group)


@pytest.mark.parametrize("model", MODELS[1:])
def test_each_surface_has_a_folder_of_its_own_whatever_its_name(model):
    counts = {"abs": 9, "wet/dry; ls $HOME": 9}
    texts = CrossValidate(data=DATA)._commands(model, counts)
    for text, ending in zip(texts, ("-abs", "-wet-dry--ls--HOME"), strict=True):
        for part in text.split(" && "):
            out = parse(shlex.split(part)[1:]).out
            assert out.parent == Path("runs")
            assert out.name.endswith(ending)


def test_the_report_of_all_studies_names_the_command_that_made_it():
    made = Reproduce(studies=("gaps",), out=Path("my runs"), recorded=DATA, trainings=2)
    again = parse(made._command("gaps", out=made.out)[1:])
    assert again == made
