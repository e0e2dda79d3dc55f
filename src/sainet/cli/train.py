"""`sainet train`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, TypeVar

from tyro.conf import AvoidSubcommands, Positional

from sainet.cli.devices import use_devices
from sainet.cli.output import Json, Output, progress_bar
from sainet.learning.recipes import PAPER, Recipe, SingleSteps
from sainet.models.identity import ModelKind
from sainet.runs.errors import BadInput

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Training:
    """Options of commands that train networks: the pushes, and where the result is."""

    data: tuple[Path, ...]
    """Dataset to train on. Several datasets, with different numbers of disks, train one
    network."""
    out: Path
    """Run folder; identical settings resume."""
    group: str | None = None
    """Group of the pushes, or their surface (default: all groups)."""
    pushes: int | None = None
    """Pushes to train on, from the start of the dataset (default: all)."""
    members: int | None = None
    """Number of networks in an ensemble, with consecutive seeds; their mean is the
    prediction, and their disagreement gives 90 % regions, calibrated on a fifth of the
    pushes (default: a single network, without regions)."""
    devices: int | None = None
    """CPU devices to split each batch over (default: one per core)."""

    def fit(
        self, model: ModelKind, engine: str, recipe: Recipe, output: Output
    ) -> Json:
        """Train a network, or an ensemble, with a progress bar.

        Args:
            model: kind of the network.
            engine: internal: a simulator, or the folder of identified parameters.
            recipe: of the training.
            output: of the command.

        Returns:
            The JSON object of the command.
        """
        use_devices(self.devices)
        from sainet.datasets.store import open_part
        from sainet.learning.ensemble import fit_ensemble
        from sainet.learning.fit import fit
        from sainet.learning.log import reported
        from sainet.report.figures.curves import draw_history

        stores = [open_part(path, self.group, self.pushes) for path in self.data]
        name, total = model.upper(), recipe.optimiser.iterations
        if self.members is None:
            with progress_bar(f"Training {name}", total, output) as advance:
                result = fit(
                    model,
                    stores,
                    recipe,
                    self.out,
                    engine=engine,
                    on_step=reported(advance),
                )
            curve = draw_history(model, result.history, self.out / "learning-curve.svg")
            output.say(f"{name} is in {self.out}, its learning curve in {curve}")
            return {"out": str(self.out), "model": model, "loss": result.loss}
        store, total = only(stores), self.members * total
        title = f"Training {self.members} {name}"
        with progress_bar(title, total, output) as advance:
            loss = fit_ensemble(
                model,
                store,
                recipe,
                self.out,
                members=self.members,
                engine=engine,
                on_step=reported(advance),
            )
        output.say(f"The ensemble is in {self.out}")
        return {"out": str(self.out), "model": model, "loss": loss}


@dataclass(frozen=True, kw_only=True)
class Train(Training):
    """Train a network by the paper's recipe.

    For few pushes, or to train a network further, use 'sainet tune'.
    """

    model: Positional[ModelKind]
    """Network: in (without an engine) or sain (around an engine)."""
    engine: str = "planar"
    """Internal engine of SAIN: planar, planar-overlap, another simulator whose
    prediction the dataset contains, or the folder of identified parameters ('sainet
    identify')."""
    single_steps: bool = False
    """Train on single steps, each from the true state (the paper's figure 2c), instead
    of whole pushes."""
    recipe: Annotated[Recipe, AvoidSubcommands] = PAPER
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Train the network and draw its learning curve."""
        recipe = self.recipe
        if self.single_steps:
            recipe = recipe.changed(horizon=SingleSteps(steps=recipe.horizon.steps))
        return self.fit(self.model, self.engine, recipe, self.output)


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
