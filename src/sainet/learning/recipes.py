"""Recipes: how a network is trained, from its first weights to its last iteration.

Every setting has one name among all parts, which options, documents and `changed` use.
Free of JAX.
"""

import math
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from typing import Any, ClassVar

from sainet.models.card import Decay, Terms, TrainingSettings
from sainet.models.identity import Features
from sainet.runs.documents import checked
from sainet.runs.errors import require, unknown_name
from sainet.scenes.quantities import require_seed

FROM_ENGINE = "engine"  # the name of the start `FromSimulator`


def _require_at_least(part: object, least: int, *names: str) -> None:
    for name in names:
        value = getattr(part, name)
        is_known = isinstance(value, int | float) and math.isfinite(value)
        require(is_known and value >= least, name, f"at least {least}", value)


@dataclass(frozen=True, kw_only=True)
class Optimiser:
    """Adam with a learning rate that falls during training."""

    iterations: int = 10_000
    """Gradient steps."""
    batch_size: int = 100
    """Pushes per gradient step."""
    learning_rate: float = 1e-3
    """Initial Adam learning rate."""
    decay: Decay = "halving"
    """Fall of the learning rate: halving (as in the paper) or cosine (to zero)."""
    halve_every: int = 2_500
    """Iterations between two halvings of the learning rate."""
    clip_norm: float = 1.0
    """Maximum norm of a gradient; larger gradients are scaled down to it."""
    average: int = 0
    """Span of the exponential mean of the weights (iterations), which is the result of
    training, because long pushes are sensitive to every step; 0: the last weights."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        _require_at_least(self, 1, "iterations", "batch_size", "halve_every")
        _require_at_least(self, 0, "average", "learning_rate", "clip_norm")
        for name in ("learning_rate", "clip_norm"):
            require(getattr(self, name) > 0, name, "positive", getattr(self, name))


@dataclass(frozen=True, kw_only=True)
class Objective:
    """The loss: weighted squared errors of the motion (eq. 3) and l2."""

    l2: float | None = 1e-6
    """Weight of the squared weights in the loss, or of their squared changes from a
    network or the engine at the start. (The paper's 1e-3 is for a loss in metres; this
    loss is scaled.) None: 1 / pushes; few pushes then change the network little."""
    weight_position: float = 1.0
    """Weight of positions in the scaled loss."""
    weight_rotation: float = 1.0
    """Weight of rotations (sine and cosine) in the scaled loss."""
    weight_velocity: float = 1.0
    """Weight of velocities in the scaled loss."""
    weight_spin: float = 1.0
    """Weight of spins in the scaled loss."""
    terms: Terms = "motion"
    """Scale of the terms of the loss. motion: the mean squared motion in the data.
    error: the mean squared error of the simulator prediction. metres: none, as in the
    paper's loss, in SI units."""
    linear_from: float = 0.0
    """Scaled error of a push above which the loss grows linearly instead of
    quadratically: failed recordings then do not dominate. 0: squared everywhere."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        names = [field.name for field in fields(self) if field.name != "terms"]
        given = [name for name in names if getattr(self, name) is not None]
        _require_at_least(self, 0, *given)

    def for_pushes(self, pushes: int) -> "Objective":
        """Return the objective with a number for l2.

        The loss is the mean over pushes. Were it their sum, as a log-likelihood is, the
        prior would have the same weight beside it for any number of them: divided by
        their number, 1 / pushes.
        """
        return replace(self, l2=1 / pushes) if self.l2 is None else self


@dataclass(frozen=True, kw_only=True)
class WholePush:
    """Predict whole pushes recurrently (the paper's figure 2d)."""

    kind: ClassVar[str] = "whole-push"

    steps: int = 200
    """Steps of each push to train on."""
    hold: int = 1
    """Zero-order-hold length for additive networks (steps): training computes their
    output once and reuses it. Only contact networks hold it in predictions, too."""
    short_iterations: int = 0
    """Number of first iterations in which pushes end after a quarter of the steps."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        _require_at_least(self, 1, "steps", "hold")
        _require_at_least(self, 0, "short_iterations")


@dataclass(frozen=True, kw_only=True)
class SingleSteps:
    """Predict single steps, each from the true state (the paper's figure 2c)."""

    kind: ClassVar[str] = "single-steps"
    hold: ClassVar[int] = 1
    short_iterations: ClassVar[int] = 0

    steps: int = 200
    """Steps of each push to train on."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        _require_at_least(self, 1, "steps")


@dataclass(frozen=True, kw_only=True)
class Augmentation:
    """Changes to the pushes of each batch that leave physics the same."""

    mirror: bool = False
    """Mirror about half of the pushes of each batch, drawn at random each time: on an
    even table, left and right are alike. No effect with the features 'place'."""


@dataclass(frozen=True, kw_only=True)
class Stopping:
    """Validation on pushes that are not trained on, and early stopping."""

    validation_share: float = 0.0
    """Share of the pushes kept for validation, drawn at random; the result is then the
    network with the lowest validation loss."""
    patience: int = 0
    """Iterations without a better validation loss after which training stops; 0: all
    iterations."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        share = self.validation_share
        require(0 <= share < 1, "validation_share", "from 0 to below 1", share)
        _require_at_least(self, 0, "patience")
        if self.patience:
            wanted = "0 without `validation_share`"
            require(share > 0, "patience", wanted, self.patience)


@dataclass(frozen=True)
class Fresh:
    """Start with random weights."""


@dataclass(frozen=True)
class FromModel:
    """Start with the weights of a network."""

    model: str = "sain"  # a shipped network, or the folder of a trained one


@dataclass(frozen=True)
class FromSimulator:
    """Start as the internal engine: an additive network whose output is zero."""


Horizon = WholePush | SingleSteps
Start = Fresh | FromModel | FromSimulator


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """How a network is trained, by default as in the paper (section IV-C)."""

    optimiser: Optimiser = Optimiser()
    objective: Objective = Objective()
    horizon: Horizon = WholePush()  # or `SingleSteps()`
    augmentation: Augmentation = Augmentation()
    stopping: Stopping = Stopping()
    start: Start = Fresh()  # or `FromModel()`, `FromSimulator()`
    features: Features = "paper"
    """Features of the network. place: also the position on the table and the absolute
    angle, with which the friction of a real surface varies. contact: features of each
    contact in its own frame (only around an engine). letter: the inputs of the paper's
    equations in SI units, along the table's axes. letter-push-frame: the same in the
    push frame. letter-motion: with relative motion, too. unbounded: the paper's,
    standardised but not bounded. whole-state: a feedforward network, for as many disks
    as in training. nominal: the paper's features, with assumed masses and radii."""
    seed: int = 0
    """Random seed of the first weights, the order of the pushes and the validation
    pushes."""
    log_every: int = 50
    """Iterations between two lines of the log."""
    checkpoint_every: int = 250
    """Iterations between two checkpoints to resume from."""

    def __post_init__(self) -> None:
        """Refuse impossible settings."""
        require_seed(self.seed)
        _require_at_least(self, 1, "log_every", "checkpoint_every")

    def changed(self, **settings: object) -> "Recipe":
        """Return the recipe with other settings, each by its name in any part.

        Raises:
            UnknownName: no part has a setting of that name.
            BadSetting: the value of a setting cannot be used.
        """
        own = {field.name for field in fields(self)}
        whole = {name: settings.pop(name) for name in own & settings.keys()}
        found = replace(self, **whole)
        places = found._places()
        for name in sorted(settings.keys() - places.keys()):
            raise unknown_name("setting", name, places)
        for part in sorted({places[name] for name in settings}):
            inner = {name: v for name, v in settings.items() if places[name] == part}
            found = replace(found, **{part: replace(getattr(found, part), **inner)})
        return found

    def _places(self) -> dict[str, str]:
        """Return the part of each setting that lies in one."""
        return {
            inner.name: field.name
            for field in fields(self)
            if is_dataclass(part := getattr(self, field.name))
            for inner in fields(part)
        }

    def settings(self) -> TrainingSettings:
        """Return every setting except the start, for documents.

        Raises:
            BadInput: a setting has a wrong type.
        """
        flat: dict[str, Any] = {"horizon": self.horizon.kind}
        for name, value in asdict(replace(self, start=Fresh())).items():
            flat |= value if isinstance(value, dict) else {name: value}
        return checked(TrainingSettings(**flat), "recipe")


PAPER = Recipe()
# For few recorded pushes, from a network and, below, as an addition to the engine:
# chosen on surrogate robots (`sainet reproduce fine-tuning`).
FINE_TUNING = PAPER.changed(
    start=FromModel(),
    iterations=300,
    batch_size=50,
    halve_every=200,
    steps=10_000,
    terms="error",
    linear_from=0.5,
    mirror=True,
    average=100,
    l2=1e-3,
    log_every=25,
)
RESIDUAL = FINE_TUNING.changed(
    start=FromSimulator(),
    iterations=1200,
    halve_every=800,
    l2=None,
    hold=8,
    weight_rotation=2.0,
)
# An addition to the engine at each contact, for any number of disks.
CONTACT = RESIDUAL.changed(
    features="contact", halve_every=400, l2=1e-3, weight_rotation=1.0
)
RECIPES = {Fresh: PAPER, FromModel: FINE_TUNING, FromSimulator: RESIDUAL}


def start_named(name: str | None) -> Start:
    """Return the start of a name: `engine`, a network, or None for random weights."""
    if name is None:
        return Fresh()
    return FromSimulator() if name == FROM_ENGINE else FromModel(name)


def recipe_for(start: Start, features: str | None = None) -> Recipe:
    """Return the recipe that fits a start, with that start.

    Args:
        start: random weights, a network, or the internal engine.
        features: of the network; `contact` has recipes of its own.
    """
    if features == "contact" and not isinstance(start, Fresh):
        other = FINE_TUNING.changed(features=features, hold=CONTACT.horizon.hold)
        return replace(other if isinstance(start, FromModel) else CONTACT, start=start)
    return replace(RECIPES[type(start)], start=start)
