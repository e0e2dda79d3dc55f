"""`sainet train`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tyro
from tyro.conf import Positional

from sainet.cli.devices import use_devices
from sainet.cli.output import Output
from sainet.cli.progress import progress_bar
from sainet.learning.config import (
    FINE_TUNING,
    FROM_ENGINE,
    RESIDUAL_TUNING,
    FitConfig,
    ModelKind,
)


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train a network on stored pushes by the paper's recipe."""

    model: Positional[ModelKind]
    """in: the network alone. sain: around an engine's prediction."""
    data: Path
    """Dataset to train on."""
    out: Path
    """Run folder to write; the same settings go on where they stopped."""
    assumed_engine: str = "planar"
    """Engine whose prediction SAIN corrects: by its name in the dataset, or the folder
    that `sainet identify` wrote."""
    start_from: str | None = None
    """Network to go on from: a shipped one or the folder of a trained one; or engine:
    a new one that adds to the assumed engine's motion, nothing at first. Other defaults
    hold then, for few recorded pushes: 'sainet train --start-from engine --help' shows
    them, and with the name of a network the others."""
    group: str | None = None
    """Group of pushes to train on (default: all groups)."""
    pushes: int | None = None
    """Pushes at the start of the dataset to train on; default: all."""
    config: FitConfig = field(default_factory=FitConfig)
    devices: int | None = None
    """CPU devices to split a batch over; default: one a core."""
    output: Output = field(default_factory=Output)

    def run(self) -> dict[str, Any]:
        """Train the network and draw its learning curve."""
        use_devices(self.devices)
        from sainet.datasets.store import open_store
        from sainet.learning.fit import fit
        from sainet.studies.curves import draw_history

        store = open_store(self.data)
        store = store if self.group is None else store.of_group(self.group)
        store = store if self.pushes is None else store.first(self.pushes)
        done = 0
        title = f"Training {self.model.upper()}"
        with progress_bar(title, self.config.iterations, self.output) as advance:

            def on_step(iteration: int, loss: float) -> None:
                nonlocal done
                advance(iteration - done, f"loss {loss:.3g}")
                done = iteration

            result = fit(
                self.model,
                store,
                self.config,
                self.out,
                assumed_engine=self.assumed_engine,
                start_from=self.start_from,
                on_step=on_step,
            )
        curve = draw_history(
            self.model, result.history, self.out / "learning-curve.svg"
        )
        self.output.say(f"{self.model.upper()} is in {self.out}, its curve in {curve}")
        loss = result.history[-1]["loss"] if result.history else None
        return {"out": str(self.out), "model": self.model, "loss": loss}


def going_on(start_from: str) -> Train:
    """Return the defaults that hold when training goes on from a network or engine."""
    needed: Any = tyro.MISSING
    config = RESIDUAL_TUNING if start_from == FROM_ENGINE else FINE_TUNING
    return Train(model=needed, data=needed, out=needed, config=config)
