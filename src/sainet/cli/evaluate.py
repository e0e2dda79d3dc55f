"""`sainet evaluate`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from sainet.cli.devices import use_devices
from sainet.cli.output import Json, Output, progress_bar
from sainet.report import WRITERS
from sainet.runs.errors import require_one_of

if TYPE_CHECKING:
    from sainet.datasets.store import Store


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Measure the errors of several models on the same stored pushes."""

    model: tuple[str, ...] = ()
    """Models to compare: physics, physics-true, shipped networks (in, sain,
    sain-bullet), or run folders of trained networks. Default: physics and the shipped
    networks that fit the data."""
    data: Path
    """Dataset of pushes to predict."""
    group: str | None = None
    """Group of pushes to predict. Default: all groups."""
    steps: int | None = None
    """Number of steps to predict; 0 for all. Default: 200, of recorded pushes all."""
    engine: str | None = None
    """Internal engine of the models. Default: planar for physics, for networks the
    engine of their training."""
    force: bool = False
    """Skip data and engine compatibility checks."""
    table: Path | None = None
    """File for the table: .md, .html, .tex or .csv. Default: none."""
    devices: int | None = None
    """Number of CPU devices that share a batch. Default: one per core."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Evaluate the models and print the table."""
        if self.table is not None:
            require_one_of("table", self.table.suffix, WRITERS)
        use_devices(self.devices)
        from sainet.datasets.store import open_part
        from sainet.evaluation.as_json import to_json_object
        from sainet.evaluation.coverage import coverage_of, in_words, to_json
        from sainet.evaluation.evaluate import evaluate
        from sainet.evaluation.summary import summarise
        from sainet.models.library import load_model, other_worlds
        from sainet.planning.checks import doubts_of_count
        from sainet.report.arrange import arrange
        from sainet.report.writers import print_table, write_table

        store = open_part(self.data, self.group)
        names = self.model or self._fitting(store)
        models = [
            load_model(name, engine=self.engine, force=self.force) for name in names
        ]
        for warning in other_worlds(models, store.info.engine):
            self.output.warn(warning)
        for model in models:
            for doubt in doubts_of_count(model.card, store.info.bodies):
                self.output.warn(f"{model.name}: {doubt}.")
        total = store.info.pushes * len(models)
        with progress_bar("Predicting", total, self.output) as advance:
            measured = evaluate(
                models,
                store,
                steps=self.steps,
                force=self.force,
                on_pushes=lambda model, pushes: advance(pushes, model),
            )
        summary = summarise(measured)
        print_table(arrange(summary), self.output.console)
        covered = coverage_of(measured)
        for sentence in in_words(covered):
            self.output.say(sentence)
        if self.table is not None:
            write_table(arrange(summary), self.table)
        return to_json_object(summary) | to_json(covered)

    def _fitting(self, store: "Store") -> list[str]:
        """Return physics and the shipped networks that fit; warn of the others."""
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
