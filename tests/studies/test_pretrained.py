"""The study of the shipped networks makes such networks."""

from importlib.util import find_spec

import msgspec
import pytest

from sainet.learning.recipes import CONTACT, PAPER
from sainet.models.card import CARD
from sainet.models.library import (
    OF_ANY_NUMBER,
    OF_PAPER,
    OF_STROKES,
    PRETRAINED,
    SHIPPED,
    load_model,
)
from sainet.runs.documents import read_json
from support import require

SAME = ("identity", "kind", "time_step", "truth_engine", "camera")
SAME += ("integrator", "disks", "format_version")
SMALLER = ("iterations", "batch_size")


@pytest.mark.slow
def test_small_networks_have_the_cards_of_shipped_networks(make, tmp_path):
    require(find_spec("pybullet"), "PyBullet is not installed")
    make("pretrained")
    into = tmp_path / "pretrained" / "networks"
    iterations = dict.fromkeys(OF_PAPER, 10_000) | dict.fromkeys(OF_STROKES, 3_000)
    iterations |= dict.fromkeys(OF_ANY_NUMBER, CONTACT.optimiser.iterations)
    assert iterations.keys() == set(SHIPPED)
    for name in SHIPPED:
        made, shipped = (
            read_json(folder / name / CARD) for folder in (into, PRETRAINED)
        )
        assert made.keys() == shipped.keys()
        assert made["manifest"].keys() == shipped["manifest"].keys()
        assert {n: made[n] for n in SAME} == {n: shipped[n] for n in SAME}
        assert shipped["recipe"].keys() == msgspec.to_builtins(PAPER.settings()).keys()
        recipes = [
            {k: v for k, v in card["recipe"].items() if k not in SMALLER}
            for card in (made, shipped)
        ]
        assert recipes[0] == recipes[1]
        assert shipped["recipe"]["iterations"] == iterations[name]
        load_model(str(into / name)).check_fits("robot", 1 / 240, seed=1)
