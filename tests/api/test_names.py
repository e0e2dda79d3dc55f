"""Every public name is found, documented and completed."""

import inspect
from dataclasses import fields

import equinox as eqx
import msgspec
import pytest

import sainet as sn
from sainet.planning.base import Plan


def test_editors_complete_the_public_names():
    assert {"load", "tune", "Push", "__version__"} <= set(dir(sn))
    assert set(sn.__all__) <= set(dir(sn))


@pytest.mark.parametrize("name", sn.__all__)
def test_a_public_name_is_documented(name):
    found = getattr(sn, name)
    assert inspect.getdoc(found)
    if not inspect.isclass(found):
        assert "Args:" in found.__doc__ or not inspect.signature(found).parameters


def test_a_model_says_what_it_is():
    assert repr(sn.load("sain")) == "<Model sain: SAIN>"
    assert repr(sn.load("physics").called("Physics")) == "<Model Physics>"


DATACLASSES = (sn.Model, sn.Track, sn.Entry, sn.SimulatedWorld, sn.Adaptation)


def shown_types() -> list[type]:
    """Public classes with fields whose shapes and units readers need."""
    found = [getattr(sn, name) for name in sn.__all__]
    modules = [each for each in found if inspect.isclass(each)]
    return [each for each in modules if issubclass(each, eqx.Module)]


@pytest.mark.parametrize("kind", [*shown_types(), *DATACLASSES, Plan])
def test_editors_show_every_field(kind):
    """In the docstring: comments in the source are shown by no editor."""
    _, _, attributes = (inspect.getdoc(kind) or "").partition("\nAttributes:\n")
    is_struct = issubclass(kind, msgspec.Struct)
    found = msgspec.structs.fields(kind) if is_struct else fields(kind)
    names = [each.name for each in found if not each.name.startswith("_")]
    missing = [name for name in names if f"    {name}: " not in attributes]
    assert not missing


@pytest.mark.parametrize("kind", [sn.State, sn.Scene, sn.Push, sn.PathControls])
def test_docstrings_state_shapes_and_units(kind):
    shown = inspect.getdoc(kind) or ""
    assert "(m)" in shown and "[" in shown
