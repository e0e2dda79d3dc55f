"""The chain that every experiment walks: simulate, train, compare."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.datasets.store import Store, open_store
from sainet.evaluation.evaluate import evaluate
from sainet.evaluation.joining import pool_trainings
from sainet.evaluation.measurements import Measurements
from sainet.learning.fit import FitResult
from sainet.learning.log import loss_note
from sainet.learning.recipes import ModelKind, Recipe
from sainet.models.identity import identity_named
from sainet.models.library import PHYSICS, Model, load_model
from sainet.runs.documents import write_document, write_json
from sainet.runs.errors import BadInput
from sainet.runs.folders import CONFIG
from sainet.runs.manifest import MANIFEST, manifest
from sainet.studies.result import TABLE, Result
from sainet.studies.trainings import Training, train_at_once

Advance = Callable[[int, str], None]
Bar = Callable[[str, int], AbstractContextManager[Advance]]


@dataclass(frozen=True)
class Chain:
    """How an experiment does its steps and tells of them."""

    out: Path
    executor: Executor
    say: Callable[[str], None]
    bar: Bar
    recorded: Path | None = None  # dataset of recorded pushes, for what needs one
    trainers: Executor | None = None  # for several networks at once; None: one by one

    def simulate(self, name: str, config: GenerateConfig) -> Store:
        """Generate a dataset into a folder of that name."""
        with self.bar(f"Simulating {name}", config.pushes) as advance:
            return generate(
                config,
                self.out / name,
                executor=self.executor,
                on_pushes=lambda pushes: advance(pushes, ""),
            )

    def train(
        self,
        model: ModelKind,
        store: Store,
        recipe: Recipe,
        *,
        name: str | None = None,
        assumed_engine: str = "planar",
    ) -> FitResult:
        """Train a network into a folder of that name, by default of its own."""
        out = self.out / (name or model)
        return self._train(Training(model, store, recipe, out, assumed_engine))

    def train_seeds(
        self, trainings: Mapping[str, Training], seeds: Sequence[int]
    ) -> dict[str, list[str]]:
        """Train every network from every seed; returns the names of their folders.

        None goes on from another, so that they are trained at once where that is
        given. What is finished is looked at here: no process has to begin for it.
        """
        several = {name: one.of_seeds(seeds) for name, one in trainings.items()}
        every = [training for those in several.values() for training in those]
        left = [training for training in every if not training.is_finished]
        if self.trainers is None or left == left[:1]:
            left = []
        for training in every:
            if training not in left:
                self._train(training)
        if self.trainers is not None and left:
            total = sum(training.iterations for training in left)
            with self._counting(f"Training {len(left)} networks", total) as on_step:
                train_at_once(left, self.trainers, on_step)
        return {name: [one.name for one in those] for name, those in several.items()}

    def _train(self, training: Training) -> FitResult:
        total = training.iterations
        with self._counting(f"Training {training.name.upper()}", total) as on_step:
            result = training.run(lambda done, loss: on_step(done, loss_note(loss)))
            last = result.history[-1]["loss"] if result.history else None
            on_step(total, loss_note(last))
        return result

    @contextmanager
    def _counting(self, title: str, total: int) -> Iterator[Advance]:
        """Show a bar that is told how much is done, not how much more."""
        shown = 0
        with self.bar(title, total) as advance:

            def on_step(done: int, note: str) -> None:
                nonlocal shown
                advance(done - shown, note)
                shown = done

            yield on_step

    def compare_trainings(
        self,
        trainings: Mapping[str, Sequence[str]],
        store: Store,
        *,
        engine: str = "planar",
    ) -> Measurements:
        """Measure the errors of physics and of networks, each of several trainings."""
        networks = [name for names in trainings.values() for name in names]
        found = self.compare(self.models(networks, engine=engine), store)
        pools = {identity_named(name): names for name, names in trainings.items()}
        return pool_trainings(found, pools)

    def recorded_pushes(self) -> Store:
        """Return the recorded pushes.

        Raises:
            BadInput: none were given.
            BadStore: they cannot be used.
        """
        if self.recorded is None:
            raise BadInput(
                "`recorded` is missing: give the dataset that 'sainet import "
                "mitpush-endpoints' made of recorded pushes."
            )
        return open_store(self.recorded)

    def compare(
        self, models: list[Model], store: Store, *, steps: int | None = None
    ) -> Measurements:
        """Measure the errors of models on the same pushes; `steps` as of `evaluate`."""
        total = len(models) * store.info.pushes
        with self.bar("Predicting", total) as advance:
            return evaluate(
                models,
                store,
                steps=steps,
                on_pushes=lambda model, pushes: advance(pushes, model),
            )

    def finish(self, result: Result, **measured: Measurements) -> Result:
        """Write the result, its measurements and its origin; return the result."""
        recorded = self.recorded and open_store(self.recorded).content
        made = {"command": "reproduce", "experiment": self.out.name}
        write_json(self.out / CONFIG, made | {"recorded": recorded})
        write_json(self.out / MANIFEST, manifest())
        for name, each in measured.items():
            each.write(self.out / f"{name.replace('_', '-')}.nc")
        write_document(self.out / TABLE, result)
        return result

    def models(
        self, networks: Sequence[str] = ("in", "sain"), *, engine: str = "planar"
    ) -> list[Model]:
        """Return the rows of the paper's tables, physics-true beside them.

        Args:
            networks: names of folders.
            engine: inside the physics models; networks have their own.
        """
        folders = [str(self.out / name) for name in networks]
        physics = [load_model(name, engine=engine) for name in PHYSICS]
        return [*physics, *map(load_model, folders)]
