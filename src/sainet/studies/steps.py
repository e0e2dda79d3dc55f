"""Steps of studies: frozen settings and inputs, whose hash names the run folder."""

import abc
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, dataclass_transform

from msgspec import structs

from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.datasets.schema import Arrays
from sainet.datasets.store import Store
from sainet.datasets.writer import derive
from sainet.evaluation.evaluate import evaluate
from sainet.evaluation.joining import join, pool_trainings
from sainet.evaluation.measurements import Condition, Measurements
from sainet.identification.identify import identify_into
from sainet.learning.fit import complete
from sainet.learning.job import Job, begin
from sainet.learning.log import loss_note
from sainet.learning.recipes import FromModel, Recipe
from sainet.models.identity import ModelId
from sainet.models.library import load_model
from sainet.models.model import Model
from sainet.runs.documents import content_hash

if TYPE_CHECKING:
    from sainet.studies.runner import Runner

T = TypeVar("T")
_FEW = 250  # pushes: a dataset of more is made in pieces
_DIGEST = 10  # characters of a hash in the name of a folder


class Place(Enum):
    """Where a step runs."""

    HERE = "in the process of the runner, in next to no time"
    APART = "in one other process, beside other steps"
    SPREAD = "in pieces, over all processes"


@dataclass_transform(frozen_default=True, eq_default=False)
@dataclass(frozen=True, eq=False)
class Step(abc.ABC, Generic[T]):
    """A piece of work, run once for equal settings and inputs: a frozen dataclass."""

    is_kept: ClassVar[bool] = False
    """Whether the result is kept in the run folder."""
    stays_with_inputs: ClassVar[bool] = False
    """Whether the shard that runs what it needs runs it, too: the steps of a fold."""

    def __init_subclass__(cls) -> None:
        """Make the class a frozen dataclass."""
        super().__init_subclass__()
        dataclass(frozen=True, eq=False)(cls)

    @property
    def name(self) -> str:
        """The beginning of the name of the run folder."""
        return type(self).__name__.lower()

    @property
    def place(self) -> Place:
        """Where it runs."""
        return Place.HERE

    @abc.abstractmethod
    def run(self, runner: "Runner") -> T:
        """Return the result; `runner` has those of all inputs."""

    @cached_property
    def key(self) -> str:
        """The hash of all settings and inputs."""
        # The representation of a dataclass names its type and contains every field.
        return content_hash(repr(self).encode())[:_DIGEST]

    @property
    def inputs(self) -> Iterator["Step[Any]"]:
        """The steps among the fields."""
        for each in fields(self):
            value = getattr(self, each.name)
            for part in value if isinstance(value, tuple) else (value,):
                if isinstance(part, Step):
                    yield part

    @property
    def folder_name(self) -> str:
        """The name of the run folder."""
        words = "".join(c if c.isalnum() or c in ".-" else " " for c in self.name)
        return "-".join([*words.split(), self.key])


class Apart(Step[T]):
    """A step that runs in one other process, if there are some."""

    @property
    def place(self) -> Place:
        """In one other process."""
        return Place.APART


class Given(Step[Store]):
    """Pushes that exist before the study begins."""

    store: Store

    def __repr__(self) -> str:
        """Return the hash of the pushes, wherever they are stored."""
        return f"Given({self.store.content})"

    def run(self, runner: "Runner") -> Store:
        """Return the pushes."""
        return self.store


class Simulate(Step[Store]):
    """A simulated dataset."""

    is_kept = True

    label: str
    config: GenerateConfig

    @property
    def place(self) -> Place:
        """In one other process if it is small."""
        return Place.APART if self.config.pushes <= _FEW else Place.SPREAD

    @property
    def name(self) -> str:
        """The label."""
        return self.label

    def run(self, runner: "Runner") -> Store:
        """Return the dataset, simulated where that is unfinished."""
        folder, executor = runner.folder(self), runner.executor
        with runner.bar(f"Simulating {self.name}", self.config.pushes) as bar:
            return generate(self.config, folder, executor=executor, on_pushes=bar.add)


class First(Step[Store]):
    """The first pushes of a dataset."""

    pushes: Step[Store]
    count: int

    def run(self, runner: "Runner") -> Store:
        """Return the pushes."""
        return runner.result(self.pushes).first(self.count)


class Rest(Step[Store]):
    """The pushes of a dataset after the first ones."""

    pushes: Step[Store]
    count: int

    def run(self, runner: "Runner") -> Store:
        """Return the pushes."""
        store = runner.result(self.pushes)
        return store.take(range(self.count, store.info.pushes))


class Derive(Apart[Store]):
    """A dataset that a function makes of another one."""

    is_kept = True

    pushes: Step[Store]

    @abc.abstractmethod
    def change(self, arrays: Arrays) -> Arrays:
        """Return the changed arrays, with fewer pushes perhaps."""

    def run(self, runner: "Runner") -> Store:
        """Return the dataset, made where that is unfinished."""
        store, folder = runner.result(self.pushes), runner.folder(self)
        return derive(store, folder, {"step": self.key}, self.change)


class Load(Step[Model]):
    """A model that needs no training: physics or a shipped network."""

    id: ModelId
    source: str  # name of the model
    engine: str | None = None  # inside; None: its own

    def run(self, runner: "Runner") -> Model:
        """Return the model."""
        return replace(load_model(self.source, engine=self.engine), id=self.id)


class Identify(Apart[Model]):
    """Physics with parameters identified on pushes."""

    is_kept = True

    id: ModelId
    pushes: Step[Store]

    def run(self, runner: "Runner") -> Model:
        """Return the model, identified where that is unfinished."""
        folder = runner.folder(self)
        identify_into(runner.result(self.pushes), folder)
        return replace(load_model(str(folder)), id=self.id)


class Train(Apart[Model]):
    """One training run of a network."""

    is_kept = True

    id: ModelId  # in tables; its simulator is the internal engine
    pushes: Step[Store]
    recipe: Recipe
    identified: Identify | None = None  # the internal engine, instead
    start: "Train | None" = None  # the network that training starts from

    @property
    def name(self) -> str:
        """The name in tables, and the seed."""
        return f"{self.id.slug}-seed-{self.recipe.seed}"

    @property
    def iterations(self) -> int:
        """The number of its iterations."""
        return self.recipe.optimiser.iterations

    def stores(self, runner: "Runner") -> Store | tuple[Store, ...]:
        """Return the training pushes."""
        return runner.result(self.pushes)

    def recipe_in(self, runner: "Runner") -> Recipe:
        """Return the recipe; a network to start from is in its run folder."""
        if self.start is None:
            return self.recipe
        return self.recipe.changed(start=FromModel(str(runner.folder(self.start))))

    def begin(self, runner: "Runner") -> Job | None:
        """Return the training run, begun or resumed; None if it is finished."""
        named = self.id.simulator.slug if self.id.simulator else "planar"
        engine = str(runner.folder(self.identified)) if self.identified else named
        return begin(
            "in" if self.id.kind == "in" else "sain",
            self.stores(runner),
            self.recipe_in(runner),
            runner.folder(self),
            engine=engine,
        )

    def run(self, runner: "Runner") -> Model:
        """Return the network, trained where that is unfinished."""
        with runner.bar(f"Training {self.name}", self.iterations) as bar:
            if job := self.begin(runner):
                complete(job, lambda done, loss: bar.reach(done, loss_note(loss)))
            bar.reach(self.iterations, bar.note)
        return replace(load_model(str(runner.folder(self))), id=self.id)


class Evaluate(Apart[Measurements]):
    """Errors of models; those of one identity are training runs of one network."""

    models: tuple[Step[Model], ...]
    pushes: Step[Store]
    condition: Condition | None = None
    steps: int | None = None  # as of `evaluate`

    def run(self, runner: "Runner") -> Measurements:
        """Return the errors."""
        store = runner.result(self.pushes)
        models = [runner.result(model) for model in self.models]
        pools: dict[ModelId, list[str]] = {}
        for number, model in enumerate(models):
            runs = pools.setdefault(model.id, [])
            runs.append(f"{model.name}, run {len(runs) + 1}")
            own = structs.replace(model.id, name=runs[-1])
            models[number] = replace(model, id=own)
        with runner.bar("Predicting", len(models) * store.info.pushes) as bar:
            found = evaluate(
                models,
                store,
                steps=self.steps,
                on_pushes=lambda model, pushes: bar.add(pushes, model),
            )
        found = pool_trainings(found, pools)
        return found if self.condition is None else found.in_condition(self.condition)


class Join(Step[Measurements]):
    """Measurements of several conditions."""

    parts: tuple[Step[Measurements], ...]

    def run(self, runner: "Runner") -> Measurements:
        """Return the measurements of all parts, one after another."""
        return join([runner.result(part) for part in self.parts])
