"""Networks on disk: what was written is what is read, or one line says why not."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from models.samples import network
from sainet.engines.assumed import PAPER_FRICTION, PAPER_MASS, PAPER_RADIUS
from sainet.models.arrays import load_arrays, save_arrays
from sainet.models.card import CARD, WEIGHTS, Card, read_card
from sainet.models.checkpoint import load_network
from sainet.models.dynamics import LearnedDynamics, PhysicsDynamics, SimulatorAugmented
from sainet.models.registry import PHYSICS, load_dynamics
from sainet.runs.documents import content_hash, write_json
from sainet.runs.errors import BadCheckpoint, UnknownName
from sainet.scenes.scene import TIME_STEP

ASSUMED = {"mass": PAPER_MASS, "radius": PAPER_RADIUS, "friction": PAPER_FRICTION}


def write_network(folder, model="sain", kind="robot", seed=0):
    """A trained network's folder, as the training leaves it."""
    data = save_arrays(folder / WEIGHTS, network(model, kind, seed))
    card = Card(
        model=model,
        kind=kind,
        time_step=TIME_STEP,
        inner_engine="planar" if model == "sain" else None,
        truth_engine="planar",
        assumed=ASSUMED if model == "sain" else None,
        data="0" * 64,
        data_seed=0,
        weights=content_hash(data),
        config={},
        manifest={},
    )
    write_json(folder / CARD, card.to_dict())
    return folder


@pytest.fixture
def folder(tmp_path):
    return write_network(tmp_path)


def edit_card(folder, **changes):
    card = json.loads((folder / CARD).read_text())
    write_json(folder / CARD, card | changes)


def weights_with(folder, change):
    """Writes other weights and a card that vouches for them."""
    data = save_arrays(folder / WEIGHTS, change(network("sain", "robot")))
    edit_card(folder, weights=content_hash(data))


@pytest.mark.parametrize("kind", ["robot", "direct-force"])
@pytest.mark.parametrize("model", ["in", "sain"])
def test_a_network_comes_back_bit_for_bit(tmp_path, model, kind):
    found, card = load_network(write_network(tmp_path, model, kind))
    wanted = network(model, kind)
    assert jax.tree.structure(found) == jax.tree.structure(wanted)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        assert one.dtype == other.dtype
        assert np.asarray(one).tobytes() == np.asarray(other).tobytes()
    assert (card.model, card.kind, card.time_step) == (model, kind, TIME_STEP)


def test_the_registry_wraps_what_the_card_says(tmp_path):
    sain = load_dynamics(str(write_network(tmp_path / "a", "sain"))).dynamics
    assert isinstance(sain, SimulatorAugmented)
    assert (sain.engine.mass, sain.engine.radius) == (PAPER_MASS, PAPER_RADIUS)
    plain = load_dynamics(str(write_network(tmp_path / "b", "in")))
    assert isinstance(plain.dynamics, LearnedDynamics)
    assert plain.name == "b"


def test_calibrated_physics_knows_the_disks_but_not_the_friction():
    found = {name: load_dynamics(name).dynamics for name in PHYSICS}
    assert all(isinstance(d, PhysicsDynamics) for d in found.values())
    assert found["physics"].engine.mass == PAPER_MASS
    calibrated = found["physics-calibrated"].engine
    assert (calibrated.mass, calibrated.radius) == (None, None)
    assert calibrated.friction == PAPER_FRICTION


def test_an_unknown_name_lists_what_there_is(tmp_path):
    with pytest.raises(UnknownName, match=r"'nothing'.*physics-calibrated.*folder"):
        load_dynamics("nothing")
    with pytest.raises(BadCheckpoint, match=r"card\.json: missing"):
        load_dynamics(str(tmp_path))


@pytest.mark.parametrize("name", [CARD, WEIGHTS])
@pytest.mark.parametrize("harm", ["missing", "empty", "truncated", "random", "folder"])
def test_a_harmed_file_is_named(folder, name, harm):
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
        load_dynamics(str(folder))
    assert "\n" not in str(raised.value)


BAD_FIELDS = {
    "format_version": [2, "1", None, 1.5],
    "model": ["mlp", None, ["in"], "in"],
    "kind": ["lab", None, ["robot"], "direct-force"],
    "time_step": ["0.004", None, 0, 1, 0.0, -0.1, 2.0, True, [0.004]],
    "inner_engine": ["havok", None, ["planar"], {}],
    "weights": ["0" * 64, None],
    "features": ["place", "everything", None],
    "started_from": [3],
    "earlier_seeds": [3, None, ["0"], [0.5], [True]],
    "residual": ["yes", None, 1],
    "config": [None, []],
    "assumed": [
        [1, 2],
        "paper",
        *(
            {"mass": bad}
            for bad in ("heavy", [], [0.9, "x"], [0, 1], [-1.0], 1.0, True)
        ),
        *({"mass": bad} for bad in ([True, 1], [float("1e999")], [[1.0]])),
        *({"radius": bad} for bad in ("wide", [], ["x"], [0.05, 0], [-0.05], {})),
        *({"friction": bad} for bad in ("ice", -0.1, [0.1], True, float("1e999"))),
        *({"pressure_radius_ratio": bad} for bad in (0, "even", True, 10**400)),
        *({"camera_x_mm": bad} for bad in ("left", True, [1.0], float("1e999"))),
    ],
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
    (folder / CARD).write_text(
        json.dumps(card)
    )  # infinity too, which ours never writes
    # A card of the other network: it is the weights that then do not fit.
    fits_not = value in ("in", "direct-force", "place")
    wanted = WEIGHTS if fits_not else f"{CARD}.*{name}"
    with pytest.raises(BadCheckpoint, match=wanted) as raised:
        load_dynamics(str(folder))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("name", ["model", "kind", "time_step", "weights", "assumed"])
def test_a_card_that_lacks_a_field_names_it(folder, name):
    card = json.loads((folder / CARD).read_text())
    del card[name]
    write_json(folder / CARD, card)
    with pytest.raises(BadCheckpoint, match=rf"{CARD}: {name} is missing"):
        read_card(folder)


def test_a_network_that_adds_to_an_engine_has_one(folder):
    edit_card(folder, model="in", residual=True)
    with pytest.raises(BadCheckpoint, match="model is 'in'; it must be 'sain' where"):
        read_card(folder)


def test_properties_that_are_not_assumed_are_the_true_ones(folder):
    edit_card(folder, assumed={"mass": None, "radius": [0.05], "friction": 0.0})
    engine = load_dynamics(str(folder)).dynamics.engine
    assert (engine.mass, engine.radius, engine.friction) == (None, (0.05,), 0.0)


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
def test_weights_that_cannot_be_are_named(folder, change, says):
    weights_with(folder, change)
    with pytest.raises(BadCheckpoint, match=rf"{WEIGHTS}: .*{says}"):
        load_network(folder)


def test_other_weights_than_the_cards_are_refused(folder):
    save_arrays(folder / WEIGHTS, network("sain", "robot", seed=1))
    with pytest.raises(
        BadCheckpoint, match=rf"{CARD}: weights .*do not belong together"
    ):
        load_network(folder)


def test_a_network_is_for_its_pushes_alone(folder):
    model = load_dynamics(str(folder))
    model.check_fits("robot", TIME_STEP)
    with pytest.raises(
        BadCheckpoint, match=r"kind is 'robot'.*'direct-force'.*`force`"
    ):
        model.check_fits("direct-force", TIME_STEP)
    with pytest.raises(BadCheckpoint, match=r"time_step is .*data's is 0\.01 s"):
        model.check_fits("robot", 0.01)
    load_dynamics("physics").check_fits("direct-force", 0.01)


def test_trees_keep_integers_and_flags(tmp_path):
    tree = {"count": jnp.int32(7), "flag": jnp.bool_(True), "x": [jnp.arange(3.0)]}
    save_arrays(tmp_path / "tree", tree)
    found = load_arrays(tmp_path / "tree", jax.tree.map(jnp.zeros_like, tree))
    assert jax.tree.map(lambda x: (x.dtype, x.tolist()), found) == jax.tree.map(
        lambda x: (x.dtype, x.tolist()), tree
    )
