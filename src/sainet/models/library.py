"""Models by name: physics, a shipped network, or the folder of a trained one."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import msgspec

from sainet.engines.simulator import (
    PAPER,
    SIMULATORS,
    TRUE_PROPERTIES,
    Assumptions,
    InternalEngine,
    PlanarSpec,
    SimulatorSpec,
    simulator_named,
)
from sainet.models.card import (
    CARD,
    IDENTIFIED,
    Card,
    Identified,
    is_identified,
    read_identified,
)
from sainet.models.checkpoint import load_network
from sainet.models.correctors.network import AbstractNetwork
from sainet.models.dynamics import (
    AbstractDynamics,
    LearnedDynamics,
    PhysicsDynamics,
    SimulatorAugmented,
)
from sainet.models.ensemble import Ensemble, stacked
from sainet.models.ensemble_card import ENSEMBLE, is_ensemble, load_ensemble, member
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.models.process_card import ProcessCard, is_process
from sainet.models.wrappers import Restarted, with_camera
from sainet.runs import errors
from sainet.runs.documents import content_hash, read_file

# What the engine of each physics model assumes; it may be any engine of `SIMULATORS`.
PHYSICS: Mapping[str, Assumptions] = {"physics": PAPER, "physics-true": TRUE_PROPERTIES}
PRETRAINED = Path(__file__).parent / "pretrained"
OF_PAPER = ("in", "sain", "sain-bullet")
OF_STROKES = ("in-stroke", "sain-stroke")  # of one disk, as recorded on a robot
OF_ANY_NUMBER = ("sain-any",)  # of disks: a contact network
SHIPPED = (*OF_PAPER, *OF_STROKES, *OF_ANY_NUMBER)
_PAPER_DISKS = 2
MODELS = (*PHYSICS, *SHIPPED)
Loadable = Model | AbstractDynamics | os.PathLike[str] | str


def as_model(model: Loadable, *, engine: str | None = None) -> Model:
    """Return a model that is given by name, as folder or as object; see `load_model`.

    Dynamics of a user's own become a model.
    """
    if isinstance(model, Model):
        return model
    if isinstance(model, AbstractDynamics):
        name = type(model).__name__.lower()
        return Model(ModelId(kind="physics", name=name), model)
    if not isinstance(model, os.PathLike | str):  # pyright: ignore
        raise errors.BadInput(
            f"model is {errors.shown(model)}; give a name, a folder or a model."
        )
    return load_model(os.fspath(model), engine=engine)


def shipped_for(disks: int) -> tuple[str, ...]:
    """Return the shipped networks to try on pushes of so many disks."""
    if disks > _PAPER_DISKS:
        return OF_PAPER + OF_ANY_NUMBER
    return OF_PAPER if disks == _PAPER_DISKS else OF_STROKES


def load_model(
    name: str,
    *,
    engine: str | None = None,
    force: bool = False,
    order: Sequence[int] | None = None,
) -> Model:
    """Return a model by its name.

    Args:
        name: `physics`, `physics-true`, a shipped network (`in`, `sain`,
            `sain-bullet`, `in-stroke`, `sain-stroke`, `sain-any`), or a folder: of a
            trained network (`./sain` where a shipped one has its name), or of
            identified parameters.
        engine: inside the model; None is planar for physics, and for a network the
            one that it was trained around.
        force: put a network around another engine all the same.
        order: of the disks whose masses and radii the internal engine assumes; None:
            as they are listed.

    Raises:
        UnknownName: neither a model nor a folder has this name, or no engine.
        BadCheckpoint: the folder holds no network that can be used, or one that was
            trained around another engine or cannot work with this one.
        BadInput: identified parameters are damaged, or of another engine.
        MissingExtra: the engine needs a package that is not installed.
    """
    if name in PHYSICS:
        return _physics(name, engine or "planar", order)
    folder = network_folder(name)
    if is_identified(folder):
        return _identified_physics(folder, engine, order)
    calibration = digest = None
    if is_ensemble(folder):
        network, card, found = load_ensemble(folder)
        calibration = found.calibration
        digest = content_hash(read_file(folder / ENSEMBLE))
    elif is_process(folder):
        from sainet.models.fitted_process import load_process  # slow: scipy.linalg

        network, card = load_process(folder)
    else:
        network, card = load_network(folder)
    dynamics: AbstractDynamics = LearnedDynamics(network)
    internal = built = None
    if card.identity.simulator is not None:
        simulator = _internal(folder, card, card.identity.simulator, engine, force)
        simulator = _ordered(simulator, order)
        internal, built = InternalEngine(simulator, card.camera), simulator.build()
        dynamics = SimulatorAugmented(network, built)
    if calibration is not None:
        assert isinstance(network, AbstractNetwork)
        dynamics = Ensemble(network, built, calibration)
    if card.has_single_steps:
        dynamics, internal = _restarted(folder, dynamics), None
    dynamics = with_camera(dynamics, card.camera)
    identity = named(card.identity, folder)
    return Model(identity, dynamics, card, folder, digest or card.weights, internal)


def load_members(folder: Path, count: int) -> tuple[Ensemble, list[Card]]:
    """Return the networks in a folder as an ensemble without regions, and their cards.

    Raises:
        BadCheckpoint: one is missing or damaged.
    """
    loaded = [load_network(member(folder, number)) for number in range(count)]
    networks, cards = zip(*loaded, strict=True)
    internal = cards[0].internal
    engine = internal and internal.simulator.build()
    return Ensemble(stacked([*networks]), engine or None), [*cards]


def named(identity: ModelId, folder: Path) -> ModelId:
    """Return the identity with the name of its folder, if that is another one."""
    name = folder.resolve().name
    return identity if identity.slug == name else _called(identity, name)


def _called(identity: ModelId, name: str) -> ModelId:
    return msgspec.structs.replace(identity, name=name)


def physics_simulator(name: str, engine: str) -> SimulatorSpec:
    """Return the simulator of a physics model: the engine with the model's assumptions.

    Raises:
        UnknownName: no simulator combines them.
    """
    assumed, each = PHYSICS[name], SIMULATORS.values()
    known = {spec.chosen_as: spec for spec in each if spec.assumptions == assumed}
    if engine not in known:
        raise errors.unknown_name("engine", engine, known)
    return known[engine]


def _ordered(simulator: SimulatorSpec, order: Sequence[int] | None) -> SimulatorSpec:
    """Return the simulator with its assumed properties in another order of disks."""
    if order is None:
        return simulator
    assumptions = simulator.assumptions.in_order(order)
    return msgspec.structs.replace(simulator, assumptions=assumptions)


def _physics(name: str, engine: str, order: Sequence[int] | None) -> Model:
    simulator = physics_simulator(name, engine)
    identity = ModelId(kind="physics", simulator=simulator)
    simulator = _ordered(simulator, order)
    internal = InternalEngine(simulator)
    return Model(identity, PhysicsDynamics(simulator.build()), internal=internal)


def _identified_physics(
    folder: Path, engine: str | None, order: Sequence[int] | None
) -> Model:
    if engine not in (None, PlanarSpec.engine):
        raise errors.BadInput(
            f"{folder / IDENTIFIED}: its parameters are those of the planar engine, "
            f"not of {engine}; leave `engine` out."
        )
    found = identified_physics(read_identified(folder), order)
    digest = content_hash(read_file(folder / IDENTIFIED))
    return replace(found, id=named(found.id, folder), folder=folder, digest=digest)


def identified_physics(found: Identified, order: Sequence[int] | None = None) -> Model:
    """Return the planar engine with estimated parameters.

    Args:
        found: the estimates.
        order: see `load_model`.
    """
    identity = ModelId(kind="physics", simulator=found.engine.simulator)
    simulator = _ordered(found.engine.simulator, order)
    internal = msgspec.structs.replace(found.engine, simulator=simulator)
    dynamics = with_camera(PhysicsDynamics(simulator.build()), internal.camera)
    return Model(identity, dynamics, internal=internal, identified=found)


def network_folder(name: str) -> Path:
    """Return the folder of a network: shipped with the package, or a path.

    Raises:
        UnknownName: there is none.
    """
    folder = PRETRAINED / name if name in SHIPPED else Path(name)
    if name in PHYSICS or not folder.exists():
        raise errors.UnknownName(
            f"No model named '{errors.shown(name)}'{errors.hint(name, MODELS)}. "
            f"Available: {', '.join(MODELS)}, or the folder of a trained network."
        )
    return folder


def _internal(
    folder: Path,
    card: Card | ProcessCard,
    own: SimulatorSpec,
    engine: str | None,
    force: bool,
) -> SimulatorSpec:
    """Return the simulator that a network is put around."""
    if engine in (None, own.chosen_as):
        return own
    if not force:
        raise errors.BadCheckpoint(
            f"{folder / CARD}: its internal engine is {own.chosen_as!r}, not "
            f"{engine!r}; leave `engine` out, train a network around that engine, or "
            "give `force`."
        )
    other = simulator_named(engine)
    return msgspec.structs.replace(other, assumptions=own.assumptions)


def _restarted(folder: Path, dynamics: AbstractDynamics) -> AbstractDynamics:
    if dynamics.on_host:
        raise errors.BadCheckpoint(
            f"{folder / CARD}: recipe.horizon is single-steps, and the engine cannot "
            "restart at every step; give `engine` planar, or train it on whole pushes."
        )
    return Restarted(dynamics)


def find_internal_engine(name: str | InternalEngine) -> InternalEngine:
    """Return an internal engine, found by the name of its simulator or its folder.

    Raises:
        UnknownName: neither a simulator nor a folder has this name.
        BadInput: the folder contains no identified parameters.
    """
    if isinstance(name, InternalEngine):
        return name
    folder = Path(name)
    if name in SIMULATORS or not folder.is_dir():
        return InternalEngine(simulator_named(name))
    return engine_of(read_identified(folder))


def engine_of(found: Identified) -> InternalEngine:
    """Return an identified engine with the pushes, to train around."""
    return msgspec.structs.replace(found.engine, pushes=found.digests)
