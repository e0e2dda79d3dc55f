"""Models by name: what ships, which engine goes inside, and what they are not for."""

import re
import subprocess
import sys

import pytest
from msgspec import structs, to_builtins

from models.samples import identified_folder
from models.test_checkpoint import edit_card, edit_simulator, write_network
from sainet.engines.planar.engine import PlanarEngine
from sainet.engines.simulator import SIMULATORS, TRUE_PROPERTIES
from sainet.models.card import CARD, IDENTIFIED, read_identified
from sainet.models.dynamics import LearnedDynamics, SimulatorAugmented
from sainet.models.library import (
    PRETRAINED,
    SHIPPED,
    find_internal_engine,
    load_model,
    shipped_for,
)
from sainet.runs.documents import write_document
from sainet.runs.errors import BadCheckpoint, MissingExtra
from sainet.scenes.scene import TIME_STEP


@pytest.fixture
def folder(tmp_path):
    return write_network(tmp_path / "net")


def test_every_shipped_folder_has_a_name():
    assert sorted(path.name for path in PRETRAINED.iterdir()) == sorted(SHIPPED)


def test_pushes_of_more_than_two_disks_also_have_the_network_for_any_number():
    assert shipped_for(1) == ("in-stroke", "sain-stroke")
    assert shipped_for(2) == ("in", "sain", "sain-bullet")
    assert shipped_for(3) == (*shipped_for(2), "sain-any")


@pytest.mark.parametrize("name", ["in", "sain"])
def test_shipped_networks_are_loaded_by_name(name):
    model = load_model(name)
    assert (model.name, model.card.identity.kind) == (name, name)
    assert (model.card.kind, model.card.truth_engine) == ("robot", "bullet")
    assert model.card.recipe.iterations == 10_000
    model.check_fits("robot", TIME_STEP, seed=1)


def test_a_network_keeps_its_engine_unless_it_is_forced(folder):
    edit_simulator(folder, engine="bullet", assumptions={"table_friction": 0.2})
    says = rf"{CARD}: its internal engine is 'bullet', not 'planar'.*force"
    with pytest.raises(BadCheckpoint, match=says):
        load_model(str(folder), engine="planar")
    forced = load_model(str(folder), engine="planar", force=True).dynamics
    assert isinstance(forced, SimulatorAugmented)
    assert isinstance(forced.engine.engine, PlanarEngine)
    # It has the assumed properties of its training.
    assert forced.engine.assumptions.table_friction == 0.2


def test_an_engine_that_keeps_overlaps_is_another_engine(folder):
    edit_simulator(folder, keeps_overlaps=True)
    says = "its internal engine is 'planar-overlap', not 'planar'"
    with pytest.raises(BadCheckpoint, match=says):
        load_model(str(folder), engine="planar")
    found = load_model(str(folder), engine="planar-overlap").dynamics
    assert isinstance(found, SimulatorAugmented)
    assert found.engine.engine.recovery == 0


@pytest.mark.parametrize(
    ("name", "simulator"),
    [("physics", "planar-overlap"), ("physics-true", "planar-true-overlap")],
)
def test_physics_may_keep_overlaps(name, simulator):
    model = load_model(name, engine="planar-overlap")
    assert model.id.simulator == SIMULATORS[simulator]


def test_an_engine_with_true_properties_is_the_same_engine(folder):
    edit_simulator(folder, assumptions={"table_friction": 0.15})
    loaded = load_model(str(folder), engine="planar").dynamics
    assert isinstance(loaded, SimulatorAugmented)
    assert loaded.engine.assumptions == TRUE_PROPERTIES


def test_a_network_without_an_engine_fits_any_engine(tmp_path):
    plain = write_network(tmp_path / "plain", "in")
    loaded = load_model(str(plain), engine="bullet")
    assert isinstance(loaded.dynamics, LearnedDynamics)
    assert loaded.internal is None


def test_without_bullet_its_network_names_the_extra(folder, monkeypatch):
    edit_simulator(folder, engine="bullet")
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(MissingExtra, match="bullet"):
        load_model(str(folder))


def test_training_pushes_are_refused_as_test_pushes(folder):
    model = load_model(str(folder))
    card = re.escape(str(folder / CARD))
    with pytest.raises(BadCheckpoint, match=rf"^{card}: data_seeds has 0.*`seed`"):
        model.check_fits("robot", TIME_STEP, seed=0)
    edit_card(folder, data_seeds=[4, 0])
    model = load_model(str(folder))
    with pytest.raises(BadCheckpoint, match="data_seeds has 4"):
        model.check_fits("robot", TIME_STEP, seed=4)
    for seed in (1, None):
        model.check_fits("robot", TIME_STEP, seed=seed)


def test_loading_a_network_does_not_import_scipy():
    code = "import sainet, sys; sainet.load('sain'); print(*sys.modules)"
    found = subprocess.check_output([sys.executable, "-c", code], text=True).split()
    assert "jax" in found
    assert "scipy.linalg" not in found


def test_an_identified_engine_brings_the_pushes_that_it_was_identified_on(tmp_path):
    engine = identified_folder(tmp_path)
    assert find_internal_engine(str(tmp_path)).settings == to_builtins(engine)
    found = structs.replace(read_identified(tmp_path), digests="AAAAAAAA")
    write_document(tmp_path / IDENTIFIED, found)
    again = find_internal_engine(str(tmp_path))
    assert (again.pushes, again.settings) == ("AAAAAAAA", to_builtins(engine))
