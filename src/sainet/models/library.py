"""Models by name: physics, a shipped network, or the folder of a trained one."""

from collections.abc import Mapping
from pathlib import Path

import msgspec

from sainet.engines.simulator import (
    SIMULATORS,
    InternalEngine,
    PlanarSpec,
    SimulatorSpec,
    simulator_named,
)
from sainet.models.camera import with_camera
from sainet.models.card import CARD, Card
from sainet.models.checkpoint import load_network
from sainet.models.dynamics import (
    AbstractDynamics,
    LearnedDynamics,
    PhysicsDynamics,
    SimulatorAugmented,
)
from sainet.models.identified import FILE, is_identified, read_identified
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.models.restarted import Restarted
from sainet.runs.documents import content_hash, read_file
from sainet.runs.errors import (
    BadCheckpoint,
    BadInput,
    UnknownName,
    hint,
    shown,
    unknown_name,
)

# Simulators by the names of physics models, for each engine.
PHYSICS: Mapping[str, Mapping[str, str]] = {
    "physics": {"planar": "planar", "bullet": "bullet"},
    "physics-true": {"planar": "planar-true", "bullet": "bullet-true"},
}
PRETRAINED = Path(__file__).parent / "pretrained"
OF_PAPER = ("in", "sain", "sain-bullet")
OF_STROKES = ("in-stroke", "sain-stroke")  # of one disk, as recorded on a robot
SHIPPED = (*OF_PAPER, *OF_STROKES)
MODELS = (*PHYSICS, *SHIPPED)


def load_model(name: str, *, engine: str | None = None, force: bool = False) -> Model:
    """Return a model by its name.

    Args:
        name: `physics`, `physics-true`, a shipped network (`in`, `sain`,
            `sain-bullet`, `in-stroke`, `sain-stroke`), or a folder: of a trained
            network (`./sain` where a shipped one has its name), or of identified
            parameters.
        engine: inside the model; None is planar for physics, and for a network the
            one that it was trained around.
        force: put a network around another engine all the same.

    Raises:
        UnknownName: neither a model nor a folder has this name, or no engine.
        BadCheckpoint: the folder holds no network that can be used, or one that was
            trained around another engine or cannot work with this one.
        BadInput: identified parameters are damaged, or of another engine.
        MissingExtra: the engine needs a package that is not installed.
    """
    if name in PHYSICS:
        return _physics(name, engine or "planar")
    folder = network_folder(name)
    if is_identified(folder):
        return _identified_physics(folder, engine)
    network, card = load_network(folder)
    dynamics: AbstractDynamics = LearnedDynamics(network)
    if card.identity.simulator is not None:
        simulator = _internal(folder, card, card.identity.simulator, engine, force)
        dynamics = SimulatorAugmented(network, simulator.build())
    if not card.recurrent:
        dynamics = _restarted(folder, dynamics)
    dynamics = with_camera(dynamics, card.camera)
    return Model(named(card.identity, folder), dynamics, card, folder, card.weights)


def named(identity: ModelId, folder: Path) -> ModelId:
    """Return the identity with the name of its folder, if that is another one."""
    name = folder.resolve().name
    return identity if identity.slug == name else _called(identity, name)


def _called(identity: ModelId, name: str) -> ModelId:
    return msgspec.structs.replace(identity, name=name)


def _physics(name: str, engine: str) -> Model:
    known = PHYSICS[name]
    if engine not in known:
        raise unknown_name("engine", engine, known)
    simulator = simulator_named(known[engine])
    identity = ModelId(kind="physics", simulator=simulator)
    return Model(identity, PhysicsDynamics(simulator.build()))


def _identified_physics(folder: Path, engine: str | None) -> Model:
    if engine not in (None, PlanarSpec.engine):
        raise BadInput(
            f"{folder / FILE}: its parameters are those of the planar engine, "
            f"not of {engine}; leave `engine` out."
        )
    internal = read_identified(folder).engine
    identity = ModelId(kind="physics", simulator=internal.simulator)
    physics = PhysicsDynamics(internal.simulator.build())
    digest = content_hash(read_file(folder / FILE))
    dynamics = with_camera(physics, internal.camera)
    return Model(named(identity, folder), dynamics, None, folder, digest)


def network_folder(name: str) -> Path:
    """Return the folder of a network: shipped with the package, or a path.

    Raises:
        UnknownName: there is none.
    """
    folder = PRETRAINED / name if name in SHIPPED else Path(name)
    if name in PHYSICS or not folder.exists():
        raise UnknownName(
            f"No model named '{shown(name)}'{hint(name, MODELS)}. Available: "
            f"{', '.join(MODELS)}, or the folder of a trained network."
        )
    return folder


def _internal(
    folder: Path, card: Card, own: SimulatorSpec, engine: str | None, force: bool
) -> SimulatorSpec:
    """Return the simulator that a network is put around."""
    if engine is None or engine == own.engine:
        return own
    if not force:
        raise BadCheckpoint(
            f"{folder / CARD}: its internal engine is {own.engine!r}, not {engine!r}; "
            "leave `engine` out, train a network around that engine, or give `force`."
        )
    other = simulator_named(engine)
    return msgspec.structs.replace(other, assumptions=own.assumptions)


def _restarted(folder: Path, dynamics: AbstractDynamics) -> AbstractDynamics:
    if dynamics.on_host:
        raise BadCheckpoint(
            f"{folder / CARD}: recurrent is false, and the engine cannot restart at "
            "every step; give `engine` planar, or train it on whole pushes."
        )
    return Restarted(dynamics)


def find_internal_engine(name: str) -> InternalEngine:
    """Return an internal engine by the name of its simulator or its folder.

    Raises:
        UnknownName: neither a simulator nor a folder has this name.
        BadInput: the folder contains no identified parameters.
    """
    folder = Path(name)
    if name in SIMULATORS or not folder.is_dir():
        return InternalEngine(simulator_named(name))
    return read_identified(folder).engine
