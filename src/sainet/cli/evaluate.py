"""`sainet evaluate`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sainet.cli.devices import use_devices
from sainet.cli.output import Output
from sainet.cli.progress import progress_bar

if TYPE_CHECKING:
    from sainet.datasets.store import Store


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Measure the errors of several models on the same stored pushes."""

    model: tuple[str, ...] = ()
    """physics, physics-true, shipped networks (in, sain, sain-bullet), or folders
    of trained ones. Default: physics and the shipped networks that fit the data."""
    data: Path
    """Dataset to predict."""
    group: str | None = None
    """Group of pushes to predict (default: all groups)."""
    steps: int | None = None
    """Steps to predict, 0 for all; default: 200, all of recorded pushes."""
    engine: str | None = None
    """Engine inside the models. Default: planar for physics, for a network the one that
    it was trained around."""
    force: bool = False
    """Use networks on other pushes, and around other engines, than they were trained
    for."""
    devices: int | None = None
    """CPU devices to split a batch over; default: one a core."""
    output: Output = field(default_factory=Output)

    def run(self) -> dict[str, Any]:
        """Evaluate the models and print the table."""
        use_devices(self.devices)
        from sainet.datasets.store import open_store
        from sainet.evaluation.evaluate import evaluate
        from sainet.models.library import load_model
        from sainet.report.tables import print_table

        store = open_store(self.data)
        store = store if self.group is None else store.of_group(self.group)
        names = self.model or self._fitting(store)
        models = [
            load_model(name, engine=self.engine, force=self.force) for name in names
        ]
        total = store.info.pushes * len(models)
        with progress_bar("Predicting", total, self.output) as advance:
            result = evaluate(
                models,
                store,
                steps=self.steps,
                force=self.force,
                on_pushes=lambda model, pushes: advance(pushes, model),
            ).to_dict()
        print_table(result, self.output.console)
        return result

    def _fitting(self, store: "Store") -> list[str]:
        """Return physics and the shipped networks that fit the data; say why not."""
        from sainet.models.library import OF_PAPER, OF_STROKES, PHYSICS, load_model
        from sainet.runs.errors import BadCheckpoint, MissingExtra

        names, info = list(PHYSICS), store.info
        for name in OF_STROKES if info.bodies == 1 else OF_PAPER:
            try:
                model = load_model(name, engine=self.engine, force=self.force)
                if not self.force:
                    model.check_fits(info.kind, info.time_step, seed=info.seed)
                names.append(name)
            except (BadCheckpoint, MissingExtra) as error:
                self.output.warn(f"Left out: {name}. {error}")
        return names
