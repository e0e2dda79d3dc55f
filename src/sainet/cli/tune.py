"""`sainet tune`."""

from dataclasses import asdict, dataclass, field
from typing import Literal

from tyro.conf import Positional

from sainet.cli.output import Json, Output
from sainet.cli.process import ProcessJob, for_networks
from sainet.cli.train import Training, only
from sainet.learning.recipes import FROM_ENGINE, RESIDUAL, recipe_for, start_named
from sainet.models.identity import Features, ModelKind, ProcessFeatures


@dataclass(frozen=True, kw_only=True)
class Changes:
    """Settings that differ from the recipe of the start."""

    iterations: int | None = None
    """Gradient steps (default: 1,200 from the engine, 300 from a network, at most 50
    for each output of gp)."""
    halve_every: int | None = None
    """Iterations between two halvings of the learning rate (default: 800 from the
    engine, 400 with the features 'contact', 200 from a network)."""
    l2: float | None = None
    """Weight of the squared changes of the weights in the loss: a smaller value allows
    larger changes (default: 1 / pushes from the engine, 0.001 from a network
    and with the features 'contact')."""
    weight_rotation: float | None = None
    """Weight of rotations in the scaled loss (default: 2 from the engine, 1 from a
    network and with the features 'contact')."""
    batch_size: int = RESIDUAL.optimiser.batch_size
    """Pushes per gradient step."""
    learning_rate: float = RESIDUAL.optimiser.learning_rate
    """Initial Adam learning rate."""
    average: int = RESIDUAL.optimiser.average
    """Span of the exponential mean of the weights (iterations); 0: the last weights."""
    linear_from: float = RESIDUAL.objective.linear_from
    """Scaled error of a push above which the loss grows linearly: failed recordings
    then do not dominate. 0: squared everywhere."""
    steps: int = RESIDUAL.horizon.steps
    """Steps of each push to train on, at most."""
    hold: int | None = None
    """Zero-order-hold length for additive networks in training, in steps (default: 8
    from the engine and with the features 'contact', 1 from a network)."""
    mirror: bool = RESIDUAL.augmentation.mirror
    """Do not mirror pushes. By default, about half of each batch is mirrored (not with
    the features 'place')."""
    validation_share: float = RESIDUAL.stopping.validation_share
    """Share of the pushes kept for validation; the result is then the network with the
    lowest validation loss."""
    patience: int = RESIDUAL.stopping.patience
    """Iterations without a better validation loss after which training stops; 0: all
    iterations."""
    features: Features | ProcessFeatures | None = None
    """Inputs of a network: paper; place adds the position on the table and the absolute
    angle, for pushes on the same part of one table; contact: features of each contact
    in its own frame, for any number of disks (only from the engine or from a network
    with these inputs). Inputs of a Gaussian process: angle is the contact angle; side
    adds the side of the disk; place adds the side, and the position and directions on
    the table (default: paper; side for a Gaussian process)."""
    choose: bool = False
    """Choose the kernel of a Gaussian process, and its inputs up to the given features,
    by cross-validation on the pushes (takes up to nine times as long)."""
    seed: int = RESIDUAL.seed
    """Random seed."""
    log_every: int = RESIDUAL.log_every
    """Iterations between two lines of the log."""


@dataclass(frozen=True, kw_only=True)
class Tune(Training):
    """Train a network, or fit a Gaussian process, on few pushes."""

    model: Positional[ModelKind | Literal["gp"]]
    """Network: in (without an engine) or sain (around an engine). gp: a Gaussian
    process around an engine, for pushes of one or two disks."""
    start: str = FROM_ENGINE
    """Start of training. engine: an additive network, whose output is added to the
    internal engine's acceleration and is zero at first. Otherwise a shipped network, or
    the folder of a trained network."""
    engine: str | None = None
    """Internal engine: the folder of identified parameters ('sainet identify'), or a
    simulator: planar, planar-overlap, or one whose prediction the dataset contains
    (default: planar, with the masses and radii of the paper's disks, for SAIN; gp
    identifies the engine on the same pushes)."""
    changes: Changes = field(default_factory=Changes)
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Train the network and draw its learning curve; or fit the process."""
        given = {k: v for k, v in asdict(self.changes).items() if v is not None}
        if self.model == "gp":
            job = only(self.data), self.out, self.engine, self.group, self.pushes
            given |= {"start": self.start, "devices": self.devices}
            given |= {"members": self.members}
            return ProcessJob(*job).run(given, asdict(Changes()), self.output)
        recipe = recipe_for(start_named(self.start), self.changes.features)
        recipe = recipe.changed(**for_networks(given))
        return self.fit(self.model, self.engine or "planar", recipe, self.output)
