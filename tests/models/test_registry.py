"""Models by name: what ships, which engine goes inside, and what they are not for."""

import re
import sys

import pytest

from models.test_checkpoint import edit_card, write_network
from sainet.engines.planar.engine import PlanarEngine
from sainet.models.card import CARD
from sainet.models.dynamics import SimulatorAugmented
from sainet.models.registry import PRETRAINED, SHIPPED, load_dynamics
from sainet.runs.errors import BadCheckpoint, MissingExtra
from sainet.scenes.scene import TIME_STEP


@pytest.fixture
def folder(tmp_path):
    return write_network(tmp_path / "net")


def test_every_shipped_folder_has_a_name():
    assert sorted(path.name for path in PRETRAINED.iterdir()) == sorted(SHIPPED)


@pytest.mark.parametrize("name", ["in", "sain"])
def test_shipped_networks_are_loaded_by_name(name):
    model = load_dynamics(name)
    assert (model.name, model.card.model) == (name, name)
    assert (model.card.kind, model.card.truth_engine) == ("robot", "bullet")
    assert model.card.config["iterations"] == 10_000
    model.check_fits("robot", TIME_STEP, seed=1)


def test_a_network_keeps_its_engine_unless_it_is_forced(folder):
    edit_card(folder, inner_engine="bullet", assumed={"friction": 0.2})
    says = rf"{CARD}: inner_engine is 'bullet', not 'planar'.*--engine.*--force"
    with pytest.raises(BadCheckpoint, match=says):
        load_dynamics(str(folder), engine="planar")
    forced = load_dynamics(str(folder), engine="planar", force=True).dynamics
    assert isinstance(forced, SimulatorAugmented)
    assert isinstance(forced.engine.engine, PlanarEngine)
    assert forced.engine.friction == 0.2  # believes what it was trained to believe


def test_a_calibrated_engine_is_the_same_engine(folder):
    edit_card(folder, inner_engine="planar-calibrated")
    load_dynamics(str(folder), engine="planar")


def test_a_plain_network_has_no_engine_to_differ_in(tmp_path):
    plain = write_network(tmp_path / "plain", "in")
    load_dynamics(str(plain), engine="bullet")


def test_without_bullet_its_network_says_what_to_install(folder, monkeypatch):
    edit_card(folder, inner_engine="bullet")
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(MissingExtra, match="bullet"):
        load_dynamics(str(folder))


def test_pushes_of_the_training_are_no_test(folder):
    model = load_dynamics(str(folder))
    card = re.escape(str(folder / CARD))
    with pytest.raises(BadCheckpoint, match=rf"^{card}: data_seed is 0.*`seed`"):
        model.check_fits("robot", TIME_STEP, seed=0)
    edit_card(folder, earlier_seeds=[4])
    model = load_dynamics(str(folder))
    with pytest.raises(BadCheckpoint, match="data_seed is 4"):
        model.check_fits("robot", TIME_STEP, seed=4)
    with pytest.raises(BadCheckpoint, match="was trained on them"):
        model.check_fits("robot", TIME_STEP, data=model.card.data)
    for seed in (1, None):
        model.check_fits("robot", TIME_STEP, seed=seed)
