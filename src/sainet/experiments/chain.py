"""The chain that every experiment walks: simulate, train, compare."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.datasets.store import Store, open_store
from sainet.errors import BadInput
from sainet.evaluation.evaluate import Evaluation, evaluate
from sainet.models.named import NamedDynamics
from sainet.models.registry import PHYSICS, load_dynamics
from sainet.runs import CONFIG, MANIFEST, manifest, write_json
from sainet.training.config import FitConfig, ModelKind
from sainet.training.fit import FitResult, fit

TABLE = "table.json"
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
        config: FitConfig,
        *,
        name: str | None = None,
        assumed_engine: str = "planar",
        start_from: str | None = None,
    ) -> FitResult:
        """Train a network into a folder of that name, by default of its own."""
        done, name = 0, name or model
        with self.bar(f"Training {name.upper()}", config.iterations) as advance:

            def on_step(iteration: int, loss: float) -> None:
                nonlocal done
                advance(iteration - done, f"loss {loss:.3g}")
                done = iteration

            return fit(
                model,
                store,
                config,
                self.out / name,
                assumed_engine=assumed_engine,
                start_from=start_from,
                on_step=on_step,
            )

    def train_several(
        self,
        model: ModelKind,
        store: Store,
        config: FitConfig,
        seeds: Sequence[int],
        *,
        name: str | None = None,
        assumed_engine: str = "planar",
        start_from: str | None = None,
    ) -> list[str]:
        """Train a network from several seeds; returns the names of their folders.

        With the name of another network, each goes on from the one of its own seed.
        """
        for seed in seeds:
            self.train(
                model,
                store,
                replace(config, seed=seed),
                name=of_seed(name or model, seed),
                assumed_engine=assumed_engine,
                start_from=start_from and str(self.out / of_seed(start_from, seed)),
            )
        return [of_seed(name or model, seed) for seed in seeds]

    def compare_trainings(
        self,
        trainings: Mapping[str, Sequence[str]],
        store: Store,
        *,
        engine: str = "planar",
    ) -> Evaluation:
        """Measure the errors of physics and of networks, each the mean of trainings."""
        networks = [name for names in trainings.values() for name in names]
        found = self.compare(self.models(networks, engine=engine), store)
        for model, names in trainings.items():
            found.pool(model, names)
        return found

    def recorded_pushes(self) -> Store:
        """Return the recorded pushes.

        Raises:
            BadInput: none were given.
            BadStore: they cannot be used.
        """
        if self.recorded is None:
            raise BadInput(
                "--recorded is missing: give the dataset that 'sainet import "
                "mitpush-endpoints' made of recorded pushes."
            )
        return open_store(self.recorded)

    def compare(
        self, models: list[NamedDynamics], store: Store, *, steps: int | None = None
    ) -> Evaluation:
        """Measure the errors of models on the same pushes; `steps` as of `evaluate`."""
        total = len(models) * store.info.pushes
        with self.bar("Predicting", total) as advance:
            return evaluate(
                models,
                store,
                steps=steps,
                on_pushes=lambda model, pushes: advance(pushes, model),
            )

    def finish(self, table: dict[str, Any]) -> dict[str, Any]:
        """Write the table, and beside it by what it was made; returns it."""
        recorded = self.recorded and open_store(self.recorded).content
        made = {"command": "reproduce", "experiment": self.out.name}
        write_json(self.out / CONFIG, made | {"recorded": recorded})
        write_json(self.out / MANIFEST, manifest())
        write_json(self.out / TABLE, table)
        return table

    def models(
        self, networks: Sequence[str] = ("in", "sain"), *, engine: str = "planar"
    ) -> list[NamedDynamics]:
        """Return the rows of the paper's tables, physics-calibrated beside them.

        Args:
            networks: names of folders.
            engine: inside the physics models; networks have their own.
        """
        folders = [str(self.out / name) for name in networks]
        physics = [load_dynamics(name, engine=engine) for name in PHYSICS]
        return [*physics, *map(load_dynamics, folders)]


def of_seed(name: str, seed: int) -> str:
    """Return the name of a training's folder."""
    return f"{name}-seed-{seed}"
