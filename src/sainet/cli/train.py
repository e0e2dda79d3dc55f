"""`sainet train`."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

from tyro.conf import AvoidSubcommands, Positional

from sainet.cli.devices import use_devices
from sainet.cli.output import Json, Output, progress_bar
from sainet.learning.recipes import PAPER, Recipe, SingleSteps
from sainet.models.identity import ModelKind
from sainet.runs.errors import BadInput

if TYPE_CHECKING:
    from sainet.datasets.store import Store

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train a network by the paper's recipe.

    For few pushes, or to train a network further, use 'sainet tune'.
    """

    model: Positional[ModelKind]
    """Network: in (without an engine) or sain (around an engine)."""
    data: tuple[Path, ...]
    """Dataset to train on. Several datasets, with different numbers of disks, train one
    network."""
    out: Path
    """Run folder; identical settings resume."""
    assumed_engine: str = "planar"
    """Internal engine of SAIN: a simulator whose prediction the dataset contains, or
    the folder of identified parameters ('sainet identify')."""
    group: str | None = None
    """Group of pushes to train on, or surface (default: all groups)."""
    pushes: int | None = None
    """Pushes to train on, from the start of the dataset (default: all)."""
    single_steps: bool = False
    """Train on single steps, each from the true state (the paper's figure 2c), instead
    of whole pushes."""
    members: int | None = None
    """Number of networks in an ensemble, with consecutive seeds; their mean is the
    prediction, and their disagreement gives 90 % regions, calibrated on a fifth of the
    pushes (default: a single network, without regions)."""
    recipe: Annotated[Recipe, AvoidSubcommands] = PAPER
    devices: int | None = None
    """CPU devices to split each batch over (default: one per core)."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Train the network and draw its learning curve."""
        recipe = self.recipe
        if self.single_steps:
            recipe = recipe.changed(horizon=SingleSteps(steps=recipe.horizon.steps))
        return Job(
            self.model,
            self.data,
            self.out,
            self.assumed_engine,
            group=self.group,
            pushes=self.pushes,
            members=self.members,
        ).run(recipe, self.devices, self.output)


@dataclass(frozen=True)
class Job:
    """A network to train, and on which pushes."""

    model: ModelKind
    data: tuple[Path, ...]
    out: Path
    engine: str  # internal: a simulator, or the folder of identified parameters
    _: KW_ONLY
    group: str | None  # None: all
    pushes: int | None  # from the start of the dataset; None: all
    members: int | None  # of an ensemble; None: a single network

    def run(self, recipe: Recipe, devices: int | None, output: Output) -> Json:
        """Train the network, with a progress bar, and draw its learning curve.

        Returns:
            The JSON object of the command.
        """
        use_devices(devices)
        from sainet.datasets.store import open_part
        from sainet.learning.fit import fit
        from sainet.learning.log import reported
        from sainet.report.figures.curves import draw_history

        stores = [open_part(path, self.group, self.pushes) for path in self.data]
        name, total = self.model.upper(), recipe.optimiser.iterations
        if self.members is not None:
            return self._ensemble(only(stores), recipe, output)
        with progress_bar(f"Training {name}", total, output) as advance:
            result = fit(
                self.model,
                stores,
                recipe,
                self.out,
                assumed_engine=self.engine,
                on_step=reported(advance),
            )
        curve = draw_history(
            self.model, result.history, self.out / "learning-curve.svg"
        )
        output.say(f"{name} is in {self.out}, its learning curve in {curve}")
        return {"out": str(self.out), "model": self.model, "loss": result.loss}

    def _ensemble(self, store: "Store", recipe: Recipe, output: Output) -> Json:
        """Train the members, and calibrate their regions."""
        from sainet.learning.ensemble import fit_ensemble
        from sainet.learning.log import reported

        count = self.members or 0
        name, total = f"{count} {self.model.upper()}", recipe.optimiser.iterations
        with progress_bar(f"Training {name}", count * total, output) as advance:
            loss = fit_ensemble(
                self.model,
                store,
                recipe,
                self.out,
                members=count,
                assumed_engine=self.engine,
                on_step=reported(advance),
            )
        output.say(f"The ensemble is in {self.out}")
        return {"out": str(self.out), "model": self.model, "loss": loss}


def only(given: Sequence[T]) -> T:
    """Return the only dataset of what is trained on one.

    Raises:
        BadInput: there are several.
    """
    if len(given) > 1:
        raise BadInput(
            f"`data`: {len(given)} datasets; ensembles and Gaussian processes are "
            "trained on one, give one."
        )
    return given[0]
