"""Models by name: physics alone, a shipped network, or the folder of a trained one."""

from pathlib import Path

from sainet.engines import ASSUMED_ENGINES, CALIBRATED, make_engine
from sainet.engines.assumed import AssumedProperties, calibrated
from sainet.engines.identified import (
    FILE,
    IDENTIFIED,
    beliefs_of,
    engine_of_beliefs,
    is_identified,
    read_values,
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
from sainet.models.named import NamedDynamics
from sainet.models.restarted import Restarted
from sainet.runs.errors import BadCheckpoint, BadInput, UnknownName

PHYSICS = {"physics": AssumedProperties, "physics-calibrated": calibrated}
PRETRAINED = Path(__file__).parent / "pretrained"
OF_PAPER = ("in", "sain", "sain-bullet")
OF_STROKES = ("in-stroke", "sain-stroke")  # of one disk, as recorded on a robot
SHIPPED = (*OF_PAPER, *OF_STROKES)
MODELS = (*PHYSICS, *SHIPPED)


def load_dynamics(
    name: str, *, engine: str | None = None, force: bool = False
) -> NamedDynamics:
    """Return a model by its name.

    Args:
        name: `physics`, `physics-calibrated`, a shipped network (`in`, `sain`,
            `sain-bullet`, `in-stroke`, `sain-stroke`), or a folder: of a trained
            network (`./sain`, say, where a shipped one has its name), or of an
            engine's identified parameters.
        engine: inside the model; None is planar for physics, and for a network the
            one that it was trained around.
        force: put a network around another engine all the same.

    Raises:
        UnknownName: neither a model nor a folder has this name.
        BadCheckpoint: the folder holds no network that can be used, or one that was
            trained around another engine or cannot work with this one.
        BadInput: identified parameters are damaged, or of another engine.
        MissingExtra: the engine needs a package that is not installed.
    """
    if name in PHYSICS:
        wrapped = PHYSICS[name](make_engine(engine or "planar"))
        return NamedDynamics(name, PhysicsDynamics(wrapped))
    folder = network_folder(name)
    if is_identified(folder):
        _check_identified(folder, engine)
        return NamedDynamics(folder.name, _identified_physics(folder), folder=folder)
    network, card = load_network(folder)
    if engine is not None and not force:
        _check_engine(folder, card, engine)
    dynamics: AbstractDynamics = LearnedDynamics(network)
    if card.model == "sain":
        dynamics = SimulatorAugmented(network, _inner_engine(folder, card, engine))
    if not card.recurrent:
        dynamics = _restarted(folder, dynamics)
    dynamics = with_camera(dynamics, card.assumed or {})
    return NamedDynamics(folder.name, dynamics, card, folder)


def _restarted(folder: Path, dynamics: AbstractDynamics) -> AbstractDynamics:
    if dynamics.on_host:
        raise BadCheckpoint(
            f"{folder / CARD}: recurrent is false, and the engine cannot restart at "
            "every step; give `engine` planar, or train it with `recurrent`."
        )
    return Restarted(dynamics)


def _identified_physics(folder: Path) -> AbstractDynamics:
    beliefs = beliefs_of(read_values(folder))
    return with_camera(PhysicsDynamics(engine_of_beliefs(beliefs)), beliefs)


def network_folder(name: str) -> Path:
    """Return where the network of this name lies: shipped with the package, or a path.

    Raises:
        UnknownName: there is none.
    """
    folder = PRETRAINED / name if name in SHIPPED else Path(name)
    if name in PHYSICS or not folder.exists():
        raise UnknownName(
            f"No model named {name!r}. Available: {', '.join(MODELS)}, or the folder "
            "of a trained network."
        )
    return folder


def _check_identified(folder: Path, engine: str | None) -> None:
    if engine not in (None, "planar"):
        raise BadInput(
            f"{folder / FILE}: its parameters are those of the planar engine, "
            f"not of {engine}; leave `engine` out."
        )


def _check_engine(folder: Path, card: Card, engine: str) -> None:
    own = card.inner_engine
    if own is not None and _made_of(own) != engine:
        raise BadCheckpoint(
            f"{folder / CARD}: inner_engine is {own!r}, not {engine!r}; leave `engine` "
            "out, train a network around that engine, or give `force`."
        )


def _made_of(inner_engine: str) -> str:
    """Return the engine that an assumed one is made of."""
    if inner_engine == IDENTIFIED:
        return "planar"
    return inner_engine.removesuffix(CALIBRATED)


def _inner_engine(folder: Path, card: Card, engine: str | None) -> AssumedProperties:
    """Return the engine with what the network was trained to believe of the scene."""
    own, assumed = card.inner_engine, card.assumed or {}
    if own == IDENTIFIED and not assumed:
        raise BadCheckpoint(
            f"{folder / CARD}: inner_engine is {own!r}, but assumed is missing, so it "
            "is not known what was identified; train it again."
        )
    if own == IDENTIFIED and engine in (None, "planar"):
        return engine_of_beliefs(assumed)
    if own not in (*ASSUMED_ENGINES, IDENTIFIED):
        raise BadCheckpoint(
            f"{folder / CARD}: inner_engine is {own!r}; this sainet has "
            f"{', '.join(sorted(ASSUMED_ENGINES))}."
        )
    return AssumedProperties(
        make_engine(engine or _made_of(own)),
        mass=_tuple(assumed.get("mass")),
        radius=_tuple(assumed.get("radius")),
        friction=assumed.get("friction"),
    )


def _tuple(values: list[float] | None) -> tuple[float, ...] | None:
    return None if values is None else tuple(values)
