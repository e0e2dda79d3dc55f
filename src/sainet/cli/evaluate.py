"""`sainet evaluate`."""

import shlex
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from sainet.cli.devices import use_devices
from sainet.cli.output import Json, Output, progress_bar
from sainet.report import WRITERS
from sainet.runs.errors import BadInput, require_one_of
from sainet.runs.executors import Machines
from sainet.runs.shards import Shard
from sainet.runs.workers import each_done

if TYPE_CHECKING:
    from sainet.datasets.store import Store
    from sainet.evaluation.measurements import Measurements
    from sainet.evaluation.parts import Parts
    from sainet.models.model import Model


_QUIET = Output(quiet=True)


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Measure the errors of several models on the same stored pushes."""

    model: tuple[str, ...] = ()
    """Models to compare: physics, physics-true, shipped networks (in, sain,
    sain-bullet, sain-any; for one disk in-stroke, sain-stroke), or run folders of
    trained models. Default: physics and the shipped networks that fit the data."""
    data: Path
    """Dataset of pushes to predict."""
    group: str | None = None
    """Group of the pushes, or their surface (default: all groups)."""
    steps: int | None = None
    """Number of steps to predict; 0 for all. Default: 200; all for recorded pushes."""
    engine: str | None = None
    """Internal engine of the models: planar, planar-overlap or bullet. Default: planar
    for physics; for networks, the engine of their training."""
    force: bool = False
    """Skip data and engine compatibility checks."""
    abstain: bool = False
    """Add a second row for each model that names the groups it was fitted to: in this
    row, physics predicts the pushes on other surfaces. Also add a row for physics."""
    table: Path | None = None
    """File for the table: .md, .html, .tex or .csv. Default: none."""
    page: Path | None = None
    """Page to write, one .html file with the table, the verdict, errors over time, and
    two animated pushes. Default: none."""
    devices: int | None = None
    """Number of CPU devices that share a batch. Default: one per core."""
    out: Path | None = None
    """Run folder for the errors of each model: an identical call resumes. Default:
    none."""
    machines: Machines = field(default_factory=Machines)
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Evaluate the models and print the table."""
        if self.table is not None:
            require_one_of("table", self.table.suffix, WRITERS)
        if self.page is not None:
            require_one_of("page", self.page.suffix, (".html",))
        machines = self.machines
        machines.refuse_with_shard(
            scheduler=machines.scheduler, table=self.table, page=self.page
        )
        use_devices(self.devices)
        from sainet.datasets.store import open_part
        from sainet.evaluation.abstention import measure, with_abstaining
        from sainet.evaluation.as_json import to_json_object
        from sainet.evaluation.coverage import coverage_of, in_words, to_json
        from sainet.evaluation.summary import summarise
        from sainet.evaluation.unlike import unlike_pushes
        from sainet.report.arrange import arrange
        from sainet.report.palette import labels_of
        from sainet.report.writers import print_table, write_table

        store = open_part(self.data, self.group)
        models = self._load(store)
        rows = with_abstaining(models) if self.abstain else models
        for warning in unlike_pushes(models, store):
            self.output.warn(warning)
        if (shard := machines.share) is not None:
            return self._measure_share(models, store, shard)
        measured = measure(rows, store, lambda plain: self._measure(plain, store))
        summary = summarise(measured)
        print_table(arrange(summary), self.output.console)
        covered = coverage_of(measured)
        for sentence in in_words(covered, labels_of(summary.models)):
            self.output.console.print(sentence, markup=False, soft_wrap=True)
        if self.table is not None:
            write_table(arrange(summary), self.table)
        self._write_page(models, store, measured)
        return to_json_object(summary) | to_json(covered)

    def _load(self, store: "Store") -> "list[Model]":
        """Return the models; physics is one of them if some may abstain."""
        from sainet.evaluation.summary import BASELINE
        from sainet.models.library import load_model

        names = [*(self.model or self._fitting(store))]
        if self.abstain and BASELINE not in names:
            names.insert(0, BASELINE)
        return [
            load_model(name, engine=self.engine, force=self.force) for name in names
        ]

    def _write_page(
        self, models: "list[Model]", store: "Store", measured: "Measurements"
    ) -> None:
        if self.page is None:
            return
        from sainet.report.pages.evaluation import write_evaluation

        command = shlex.join(["sainet", *sys.argv[1:]])
        write_evaluation(
            models, store, measured, self.page, steps=self.steps, command=command
        )
        self.output.say(f"Open {self.page} in a browser.")

    def _measure(self, models: "list[Model]", store: "Store") -> "Measurements":
        """Return the errors of all models, measured where that is missing."""
        if self.machines.scheduler is not None:
            self._measure_elsewhere(models)
        if self.out is None:
            return self._evaluate(models, store, None)
        parts = self._parts(self.out, models, store)
        shards = parts.collect(models)
        measured = self._evaluate(models, store, parts)
        if shards is not None:
            shards.clear()
        return measured

    def _measure_elsewhere(self, models: "list[Model]") -> None:
        """Measure the errors of each model on a worker of the scheduler, as a shard."""
        shards = [Shard(1 + index, len(models)) for index in range(len(models))]
        jobs = [
            (replace(self, machines=Machines(shard=str(shard)), output=_QUIET), index)
            for index, shard in enumerate(shards)
        ]
        bar = progress_bar("Predicting", len(models), self.output)
        with self.machines.executor() as executor, bar as advance:
            for index in each_done(executor, Evaluate.measure_part, jobs):
                advance(1, models[index].name)

    def measure_part(self, index: int) -> int:
        """Measure the errors of the models of the shard, and return a number.

        The job of a worker.
        """
        from sainet.datasets.store import open_part

        store, shard = open_part(self.data, self.group), self.machines.share
        assert shard is not None
        self._measure_share(self._load(store), store, shard)
        return index

    def _measure_share(
        self, models: "list[Model]", store: "Store", shard: Shard
    ) -> Json:
        """Measure the errors of the models of a shard."""
        if self.out is None:
            raise BadInput("`out` is missing; give the folder for errors of models.")
        parts = self._parts(self.out, models, store, shared=True)
        own = [models[index] for index in shard.own(len(models))]
        with parts.share(shard) as share:
            for model in own:
                self._evaluate([model], store, parts)
                share.add(model.name)
        self.output.say(f"Errors of {len(own)} models of shard {shard}: {self.out}")
        return {"out": str(self.out), "shard": str(shard), "models": len(own)}

    def _parts(
        self, out: Path, models: "list[Model]", store: "Store", *, shared: bool = False
    ) -> "Parts":
        from sainet.evaluation.parts import Parts

        settings = {"steps": self.steps, "engine": self.engine, "force": self.force}
        return Parts.open(out, models, store, settings, shared=shared)

    def _evaluate(
        self, models: "list[Model]", store: "Store", parts: "Parts | None"
    ) -> "Measurements":
        from sainet.evaluation.evaluate import evaluate

        total = store.info.pushes * len(models)
        with progress_bar("Predicting", total, self.output) as advance:
            return evaluate(
                models,
                store,
                steps=self.steps,
                force=self.force,
                on_pushes=lambda model, pushes: advance(pushes, model),
                parts=parts,
            )

    def _fitting(self, store: "Store") -> list[str]:
        """Return physics and the shipped networks that fit; warn of the others."""
        from sainet.models.library import PHYSICS, load_model, shipped_for
        from sainet.runs.errors import BadCheckpoint, MissingExtra

        names, info = list(PHYSICS), store.info
        for name in shipped_for(info.bodies):
            try:
                model = load_model(name, engine=self.engine, force=self.force)
                if not self.force:
                    model.check_fits(info.kind, info.time_step, seed=info.seed)
                names.append(name)
            except (BadCheckpoint, MissingExtra) as error:
                self.output.warn(f"Left out: {name}. {error}")
        return names
