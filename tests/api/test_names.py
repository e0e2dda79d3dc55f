"""Every public name is found, documented and completed."""

import inspect

import pytest

import sainet as sn


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
