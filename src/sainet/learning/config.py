"""Settings of training, free of JAX."""

from dataclasses import dataclass, replace
from typing import Literal

from sainet.runs.errors import require

ModelKind = Literal["in", "sain"]
Features = Literal["paper", "place"]
Terms = Literal["motion", "error"]
FROM_ENGINE = "engine"  # where a network starts that corrects the engine from nothing

_LARGE = 1e12  # so that settings stay finite and positive in single precision


@dataclass(frozen=True, kw_only=True)
class FitConfig:
    """The paper's recipe (section IV-C)."""

    iterations: int = 10_000
    """Number of gradient steps."""
    batch_size: int = 100
    """Pushes in a gradient step."""
    learning_rate: float = 1e-3
    """Of Adam at the start."""
    halve_every: int = 2_500
    """Iterations after which the learning rate is halved."""
    l2: float | None = 1e-6
    """Weight of the squared weights in the loss (the paper's 1e-3 is for a loss in
    metres, not for the standardised one). Of a network that training goes on from, the
    squares of what is changed are meant. None: 1 / pushes, for the fewer pushes there
    are, the less they should change."""
    steps: int = 200
    """Steps of a push that are trained on; pushes of 600 steps, say, need 600."""
    hold: int = 1
    """Steps over which what a residual network says is held in training: it is asked
    so many times less often. Predictions never hold it; other networks are never
    held."""
    recurrent: bool = True
    """On: train on whole pushes. Off: on single steps, each from the true state (the
    paper's figure 2c)."""
    seed: int = 0
    """Of the first weights and of the order of the pushes."""
    weight_position: float = 1.0
    """Weight of the position in the loss, once it is standardised."""
    weight_rotation: float = 1.0
    """Weight of the sine and cosine of the rotation."""
    weight_velocity: float = 1.0
    """Weight of the velocity."""
    weight_spin: float = 1.0
    """Weight of the spin."""
    clip_norm: float = 1.0
    """Greatest norm of a gradient; longer ones are shortened to it."""
    features: Features = "paper"
    """place: the network also sees where on the table a body is and at which absolute
    angle; the friction of a real surface varies with both."""
    terms: Terms = "motion"
    """What the terms of the loss are measured by: how far things move in the data, or
    how wrong the assumed engine is about it."""
    linear_from: float = 0.0
    """Error of a push, as the terms measure it, from which it counts linearly and no
    longer squared, so that a few failed recordings do not rule; 0: nowhere."""
    mirror: bool = False
    """On: about half of the pushes of each batch are shown mirrored, others each time,
    for disks on an even table know no left and right; never to networks that see the
    place. Off: all as they are."""
    average: int = 0
    """Iterations that the weights are averaged over, by an exponential mean: the mean
    is then the network. A long stroke feels every step of the weights, which jump about
    what is best; 0: the network has the last weights."""
    validation_share: float = 0.0
    """Share of the pushes, drawn at random, that is kept for validation; the network
    is then the one that was best on them."""
    patience: int = 0
    """Iterations without a better validation loss after which training ends; 0: it
    goes on to its last iteration."""
    log_every: int = 50
    """Iterations between two lines of the log."""
    checkpoint_every: int = 250
    """Iterations between two checkpoints to resume from."""

    def __post_init__(self) -> None:
        """Refuse settings that no training can have."""
        for name in ("iterations", "batch_size", "halve_every", "steps", "hold"):
            require(getattr(self, name) >= 1, name, "at least 1", getattr(self, name))
        for name in ("log_every", "checkpoint_every"):
            require(getattr(self, name) >= 1, name, "at least 1", getattr(self, name))
        for name in ("learning_rate", "clip_norm"):
            value = getattr(self, name)
            require(
                1 / _LARGE <= value <= _LARGE,
                name,
                f"from {1 / _LARGE:g} to {_LARGE:g}",
                value,
            )
        weights = [f"weight_{n}" for n in ("position", "rotation", "velocity", "spin")]
        others = ("linear_from", "average", "patience", "seed")
        l2 = () if self.l2 is None else ("l2",)
        for name in (*l2, *weights, *others):
            value = getattr(self, name)
            require(0 <= value <= _LARGE, name, f"from 0 to {_LARGE:g}", value)
        share = self.validation_share
        require(0 <= share < 1, "validation_share", "from 0 to below 1", share)
        if self.patience:
            require(
                share > 0, "patience", "0 without `validation_share`", self.patience
            )

    def for_pushes(self, pushes: int) -> "FitConfig":
        """Return the settings with a number for what so many pushes decide.

        The loss is the mean over pushes. Were it their sum, as the logarithm of a
        likelihood is, what is believed before any push would have the same weight
        beside it however many there are: divided by their number, 1 / pushes.
        """
        return replace(self, l2=1 / pushes) if self.l2 is None else self


# For what goes on from a network, and below for what is added to the engine, on few
# recorded pushes: chosen on simulated robots (`sainet reproduce fine-tuning`).
FINE_TUNING = FitConfig(
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
RESIDUAL_TUNING = replace(
    FINE_TUNING,
    iterations=1200,
    halve_every=800,
    l2=None,
    hold=8,
    weight_rotation=2.0,
)
