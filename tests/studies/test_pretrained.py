"""The command that makes the shipped networks makes such networks."""

import runpy
from importlib.util import find_spec

import pytest

from sainet.learning.recipes import PAPER
from sainet.models.card import CARD
from sainet.models.library import (
    OF_PAPER,
    OF_STROKES,
    PRETRAINED,
    SHIPPED,
    load_model,
)
from sainet.runs.documents import read_json
from sainet.studies.paper_setup import paper_setup
from sainet.studies.strokes import stroke_setup
from support import REPOSITORY, require

SAME = ("identity", "kind", "time_step", "truth_engine", "camera", "data_seeds")
SAME += ("recurrent", "residual", "format_version")
SMALLER = ("iterations", "batch_size")


@pytest.mark.slow
def test_small_networks_have_the_cards_of_shipped_networks(tiny, chain, tmp_path):
    require(find_spec("pybullet"), "PyBullet is not installed")
    tool = runpy.run_path(str(REPOSITORY / "tools" / "pretrained.py"))
    tool["build"](paper_setup("robot", "quick", chain), tmp_path / "into")
    tool["build_strokes"](stroke_setup("quick", chain), tmp_path / "into")
    iterations = dict.fromkeys(OF_PAPER, 10_000) | dict.fromkeys(OF_STROKES, 3_000)
    assert iterations.keys() == set(SHIPPED)
    for name in SHIPPED:
        made, shipped = (
            read_json(folder / name / CARD)
            for folder in (tmp_path / "into", PRETRAINED)
        )
        assert made.keys() == shipped.keys()
        assert made["manifest"].keys() == shipped["manifest"].keys()
        assert {n: made[n] for n in SAME} == {n: shipped[n] for n in SAME}
        assert shipped["config"].keys() == PAPER.settings().keys()
        recipes = [
            {k: v for k, v in card["config"].items() if k not in SMALLER}
            for card in (made, shipped)
        ]
        assert recipes[0] == recipes[1]
        assert shipped["config"]["iterations"] == iterations[name]
        load_model(str(tmp_path / "into" / name)).check_fits("robot", 1 / 240, seed=1)
