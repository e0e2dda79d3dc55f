"""A small store that most tests only read."""

import pytest

from datasets.stores import small
from sainet.datasets.generate import generate


@pytest.fixture(scope="session")
def whole_store(tmp_path_factory):
    """The folder of an undisturbed small store. Copy it before you change it."""
    folder = tmp_path_factory.mktemp("whole") / "store"
    generate(small(), folder)
    return folder
