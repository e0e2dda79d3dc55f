"""Datasets that the tests of the Python interface share."""

import pytest

from sainet import GenerateConfig, Pushes, generate, open_pushes

SMALL = GenerateConfig(
    pushes=12,
    chunk_size=12,
    stroke_mm=(2.0,),
    hold_steps=30,
    noise_level="none",
    seed=7,  # no network that ships was trained on it
)


@pytest.fixture
def small() -> GenerateConfig:
    """The settings of `pushes`."""
    return SMALL


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Twelve short simulated pushes of two disks, where the program looks for them."""
    folder = tmp_path_factory.mktemp("api")
    generate(SMALL, folder / "runs" / "recorded")
    return folder


@pytest.fixture
def pushes(folder) -> Pushes:
    return open_pushes(folder / "runs" / "recorded")
