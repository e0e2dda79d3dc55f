"""Explaining pictures: complete, deterministic, and drawn from what they explain."""

import re

import numpy as np
import pytest

from sainet.datasets.recorded.own import COLUMNS
from sainet.report.pictures import PICTURES
from sainet.report.pictures.one_push import _predictions
from support import REPOSITORY

# What each picture must name.
TEXTS = {
    "chart": ("physics-true", "identify", "yes", "no"),
    "method": ("Internal engine", "Network", "Ground truth s"),
    "one-push": ("Truth", "Physics", "IN", "SAIN"),
    "push-frame": ("α", "β", "contact normal", "disk 1", "disk 2"),
    "table-columns": ("x", "y", "angle", "pusher_x", "pusher_y"),
}
QUICK = [name for name in PICTURES if name != "one-push"]  # without a prediction


def words(text: str) -> str:
    return " ".join(re.findall(r"<text[^>]*>([^<]*)</text>", text))


@pytest.mark.parametrize("name", QUICK)
def test_a_picture_has_the_same_bytes_again(name, tmp_path):
    first, again = (PICTURES[name](tmp_path / f"{i}.svg") for i in range(2))
    assert first.read_bytes() == again.read_bytes()


@pytest.mark.parametrize("name", PICTURES)
def test_the_kept_picture_names_its_parts(name):
    text = (REPOSITORY / "docs" / "figures" / f"{name}.svg").read_text("utf-8")
    shown = words(text)
    assert all(each in shown for each in TEXTS[name])


def test_the_picture_of_columns_has_the_columns_of_the_importer():
    text = (REPOSITORY / "docs" / "figures" / "table-columns.svg").read_text("utf-8")
    drawn = set(words(text).replace("=", " ").split())
    assert set(COLUMNS.numbers) - {"time"} <= drawn


def test_the_models_predict_the_drawn_push_as_its_caption_states():
    paths = _predictions()
    ends = {name: path[-1] - paths["truth"][-1] for name, path in paths.items()}
    errors = {
        name: float(np.linalg.norm(end, axis=-1).mean()) for name, end in ends.items()
    }
    assert errors["in"] < errors["physics"] and errors["sain"] < errors["physics"]


def test_the_picture_of_the_live_page_is_small_and_shown():
    """`tests/report/live/picture.py` takes it."""
    data = (REPOSITORY / "docs" / "figures" / "play.png").read_bytes()
    assert data.startswith(b"\x89PNG") and len(data) < 150_000
    for page, link in (
        ("README.md", "docs/figures/play.png"),
        ("docs/tutorial-control.md", "figures/play.png"),
    ):
        assert f"]({link})" in (REPOSITORY / page).read_text("utf-8")
