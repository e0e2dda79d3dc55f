"""Networks on disk: round trips, and one-line errors for damaged files."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from msgspec import structs
from safetensors.numpy import save

from models.samples import CARD as SAMPLE
from models.samples import network
from sainet.engines.simulator import PAPER, PlanarSpec
from sainet.models.card import CARD, WEIGHTS, read_card
from sainet.models.checkpoint import (
    load_arrays,
    load_network,
    read_arrays,
    save_arrays,
    write_arrays,
)
from sainet.models.dynamics import LearnedDynamics, PhysicsDynamics, SimulatorAugmented
from sainet.models.identity import ModelId
from sainet.models.library import PHYSICS, load_model
from sainet.runs.documents import content_hash, write_document, write_json
from sainet.runs.errors import BadCheckpoint, BadInput, UnknownName
from sainet.scenes.scene import TIME_STEP
from support import write_sealed


def write_network(folder, model="sain", kind="robot", seed=0):
    """A trained network's folder, as the training leaves it."""
    data = save_arrays(folder / WEIGHTS, network(model, kind, seed))
    simulator = PlanarSpec() if model == "sain" else None
    card = structs.replace(
        SAMPLE,
        identity=ModelId(kind=model, simulator=simulator),
        kind=kind,
        data_seeds=(0,),
        weights=content_hash(data),
    )
    write_document(folder / CARD, card)
    return folder


@pytest.fixture
def folder(tmp_path):
    return write_network(tmp_path)


def edit_card(folder, **changes):
    card = json.loads((folder / CARD).read_text())
    write_sealed(folder / CARD, card | changes)


def edit_simulator(folder, **changes):
    identity = json.loads((folder / CARD).read_text())["identity"]
    simulator = identity["simulator"] | changes
    edit_card(folder, identity=identity | {"simulator": simulator})


def edit_assumptions(folder, **changes):
    card = json.loads((folder / CARD).read_text())
    assumed = card["identity"]["simulator"]["assumptions"]
    edit_simulator(folder, assumptions=assumed | changes)


def weights_with(folder, change):
    """Writes other weights and a card that vouches for them."""
    data = save_arrays(folder / WEIGHTS, change(network("sain", "robot")))
    edit_card(folder, weights=content_hash(data))


@pytest.mark.parametrize("kind", ["robot", "direct-force"])
@pytest.mark.parametrize("model", ["in", "sain"])
def test_a_loaded_network_is_identical(tmp_path, model, kind):
    found, card = load_network(write_network(tmp_path, model, kind))
    wanted = network(model, kind)
    assert jax.tree.structure(found) == jax.tree.structure(wanted)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        assert one.dtype == other.dtype
        assert np.asarray(one).tobytes() == np.asarray(other).tobytes()
    assert (card.identity.kind, card.kind, card.time_step) == (model, kind, TIME_STEP)


def test_the_registry_builds_the_model_of_the_card(tmp_path):
    sain = load_model(str(write_network(tmp_path / "a", "sain"))).dynamics
    assert isinstance(sain, SimulatorAugmented)
    assert sain.engine.assumptions == PAPER
    plain = load_model(str(write_network(tmp_path / "b", "in")))
    assert isinstance(plain.dynamics, LearnedDynamics)
    assert plain.name == "b"


def test_true_property_physics_assumes_the_table_friction_only():
    found = {name: load_model(name).dynamics for name in PHYSICS}
    assert all(isinstance(d, PhysicsDynamics) for d in found.values())
    assert found["physics"].engine.assumptions == PAPER
    true = found["physics-true"].engine.assumptions
    assert (true.mass, true.radius) == (None, None)
    assert true.table_friction == PAPER.table_friction


def test_an_unknown_model_lists_the_available_models(tmp_path):
    with pytest.raises(UnknownName, match=r"'nothing'.*physics-true.*folder"):
        load_model("nothing")
    with pytest.raises(BadCheckpoint, match=r"card\.json: not found"):
        load_model(str(tmp_path))


@pytest.mark.parametrize("name", [CARD, WEIGHTS])
@pytest.mark.parametrize("harm", ["missing", "empty", "truncated", "random", "folder"])
def test_a_damaged_weights_file_is_named(folder, name, harm):
    path = folder / name
    whole = path.read_bytes()
    path.unlink()
    rng = np.random.default_rng(0)
    if harm == "folder":
        path.mkdir()
    elif harm != "missing":
        kept = {"empty": b"", "truncated": whole[: len(whole) // 2]}
        path.write_bytes(kept.get(harm, rng.bytes(500)))
    with pytest.raises(BadCheckpoint, match=name) as raised:
        load_model(str(folder))
    assert "\n" not in str(raised.value)


BAD_FIELDS = {
    "format_version": [1, 2, 4, "3", None, 1.5],
    "kind": ["lab", None, ["robot"], "direct-force"],
    "time_step": ["0.004", None, 0, 1, 0.0, -0.1, 2.0, True, [0.004]],
    "weights": ["0" * 64, None],
    "started_from": [3],
    "data_seeds": [3, None, ["0"], [0.5], [True]],
    "integrator": ["yes", None, True],
    "disks": [0, None, 1.5],
    "trained_pushes": [0, "many", None],
    "recipe": [None, [], {}],
    "manifest": [None, [], {}],
}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        pytest.param(name, value, id=f"{name}={value}")
        for name, values in BAD_FIELDS.items()
        for value in values
    ],
)
def test_a_card_with_a_bad_field_names_it(folder, name, value):
    card = json.loads((folder / CARD).read_text()) | {name: value}
    write_sealed(folder / CARD, card)
    # A card of the other setup, or with another hash: the weights then do not fit.
    fits_not = value in ("direct-force", "0" * 64)
    wanted = WEIGHTS if fits_not else f"{CARD}.*{name}"
    with pytest.raises(BadCheckpoint, match=wanted) as raised:
        load_model(str(folder))
    assert "\n" not in str(raised.value)


BAD_ASSUMPTIONS = {
    "mass": ["heavy", [0.9, "x"], [0, 1], [-1.0], 1.0, True, [True, 1], [[1.0]]],
    "radius": ["wide", ["x"], [0.05, 0], [-0.05], {}, [100.0], [1e-46]],
    "table_friction": ["ice", -0.1, [0.1], True, 1e30],
    "pusher_friction": [-1, 10**400],
}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        pytest.param(name, value, id=f"{name}={str(value)[:20]}")
        for name, values in BAD_ASSUMPTIONS.items()
        for value in values
    ],
)
def test_assumptions_out_of_bounds_are_refused_with_their_field(folder, name, value):
    edit_assumptions(folder, **{name: value})
    with pytest.raises(BadCheckpoint, match=rf"{CARD}: .*{name}") as raised:
        load_model(str(folder))
    assert "\n" not in str(raised.value)
    assert len(str(raised.value)) < 500


@pytest.mark.parametrize(
    "changes",
    [
        {"pressure_radius_ratio": 50},
        {"pressure_radius_ratio": "even"},
        {"engine": "havok"},
        {"engine": None},
        {"version": "new"},
    ],
)
def test_a_simulator_that_cannot_be_is_refused(folder, changes):
    edit_simulator(folder, **changes)
    with pytest.raises(BadCheckpoint, match=rf"{CARD}: .*simulator"):
        load_model(str(folder))


@pytest.mark.parametrize("offset", [{"x": "left"}, {"x": True}, {"y": 5.0}, [1.0]])
def test_a_camera_that_cannot_be_is_refused(folder, offset):
    edit_card(folder, camera=offset)
    with pytest.raises(BadCheckpoint, match=rf"{CARD}: .*camera"):
        load_model(str(folder))


@pytest.mark.parametrize("name", ["identity", "kind", "time_step", "weights", "data"])
def test_a_card_that_lacks_a_field_names_it(folder, name):
    card = json.loads((folder / CARD).read_text())
    del card[name]
    write_sealed(folder / CARD, card)
    with pytest.raises(BadCheckpoint, match=rf"{CARD}: .*`{name}`"):
        read_card(folder)


@pytest.mark.parametrize(
    ("identity", "says"),
    [
        ({"kind": "physics"}, "identity.kind is 'physics'"),
        ({"kind": "sain"}, "identity.simulator is missing"),
        ({"kind": "in", "simulator": {"engine": "planar"}}, "there is one for 'in'"),
    ],
)
def test_a_network_that_cannot_be_is_refused(folder, identity, says):
    edit_card(folder, identity=identity)
    with pytest.raises(BadCheckpoint, match=says):
        read_card(folder)


def test_an_additive_network_needs_an_internal_engine(folder):
    edit_card(folder, identity={"kind": "in"}, integrator="relaxing-residual")
    with pytest.raises(
        BadCheckpoint, match="integrator is 'relaxing-residual'.*must then be 'sain'"
    ):
        read_card(folder)


def test_properties_that_are_not_assumed_stay_the_scenes(folder):
    edit_assumptions(folder, mass=None, radius=[0.05], table_friction=0.0)
    assumed = load_model(str(folder)).dynamics.engine.assumptions
    assert (assumed.mass, assumed.radius) == (None, (0.05,))
    assert assumed.table_friction == 0.0


def harmed(change):
    return lambda net: jax.tree.map(change, net)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (harmed(lambda w: w[:-1]), "belongs to another network"),
        (harmed(lambda w: w.astype(jnp.float16)), "belongs to another network"),
        (harmed(lambda w: w.at[0].set(jnp.nan)), "holds NaN"),
        (harmed(lambda w: w.at[0].set(jnp.inf)), "NaN or infinity"),
        (lambda net: net.rel, "is missing"),
    ],
)
def test_impossible_weights_are_named(folder, change, says):
    weights_with(folder, change)
    with pytest.raises(BadCheckpoint, match=rf"{WEIGHTS}: .*{says}"):
        load_network(folder)


def test_other_weights_than_the_cards_are_refused(folder):
    save_arrays(folder / WEIGHTS, network("sain", "robot", seed=1))
    with pytest.raises(BadCheckpoint, match=rf"{WEIGHTS}: .*do not belong together"):
        load_network(folder)


def test_an_edited_card_is_refused(folder):
    card = json.loads((folder / CARD).read_text())
    edits = (
        (card | {"trained_pushes": 9}, "the file was edited"),
        ({k: v for k, v in card.items() if k != "seal"}, "missing: .* earlier sainet"),
    )
    for edited, says in edits:
        write_json(folder / CARD, edited)
        with pytest.raises(BadCheckpoint, match=rf"{CARD}: seal: {says}.* Train it"):
            read_card(folder)


def test_edited_arrays_are_refused_unless_a_card_has_their_hash(tmp_path):
    path, array = tmp_path / "arrays", np.arange(3.0)
    data = write_arrays(path, {"a": array})
    np.testing.assert_array_equal(read_arrays(path)["a"], array)
    edits = {
        "the file was edited": data.replace(array.tobytes(), (array / 9).tobytes()),
        "missing": save({"a": array}),  # as other programs write it
    }
    for says, edited in edits.items():
        path.write_bytes(edited)
        with pytest.raises(BadInput, match=f"arrays: seal: {says}.* Delete it, then"):
            read_arrays(path)
        assert read_arrays(path, known=content_hash(edited))


def test_a_network_is_refused_on_other_pushes(folder):
    model = load_model(str(folder))
    model.check_fits("robot", TIME_STEP)
    says = r"kind is 'robot'.*'direct-force'.*`force`"
    with pytest.raises(BadCheckpoint, match=says):
        model.check_fits("direct-force", TIME_STEP)
    with pytest.raises(BadCheckpoint, match=r"time_step is .*data's is 0\.01 s"):
        model.check_fits("robot", 0.01)
    load_model("physics").check_fits("direct-force", 0.01)


def test_trees_keep_integers_and_flags(tmp_path):
    tree = {"count": jnp.int32(7), "flag": jnp.bool_(True), "x": [jnp.arange(3.0)]}
    save_arrays(tmp_path / "tree", tree)
    found = load_arrays(tmp_path / "tree", jax.tree.map(jnp.zeros_like, tree))
    assert jax.tree.map(lambda x: (x.dtype, x.tolist()), found) == jax.tree.map(
        lambda x: (x.dtype, x.tolist()), tree
    )
