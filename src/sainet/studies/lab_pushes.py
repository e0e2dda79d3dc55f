"""Pushes collected in virtual labs, the models made of them, and errors over labs.

Labs differ in hidden properties. Each has models of its own, which were trained on its
own pushes; intervals are over labs and their pushes (`evaluation/intervals.py`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from msgspec import structs

from sainet.control.collect import collect
from sainet.control.config import CollectConfig
from sainet.datasets.store import Store
from sainet.evaluation.joining import join
from sainet.evaluation.measurements import Condition, Measurements
from sainet.learning.recipes import FINE_TUNING, FromModel
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.report.figures.overview import draw_errors
from sainet.robots import SURFACES, Surface
from sainet.runs.errors import missing_extra
from sainet.studies import Scale, steps
from sainet.studies.paper_setup import IN, SAIN, physics, scaled
from sainet.studies.recorded_models import IDENTIFIED, Variant
from sainet.studies.study import Need, Plan, Scope, Study

if TYPE_CHECKING:
    from sainet.studies.runner import Runner

WORLD = "virtual lab"
TUNED = (Variant("in", "tuned"), Variant("sain", "tuned"))
IN_TUNED, SAIN_TUNED = (variant.identity() for variant in TUNED)
# Fine-tuned around the engine with parameters identified on the same pushes.
AROUND_IDENTIFIED = Variant("sain", "tuned", "identified")


@dataclass(frozen=True)
class Sizes:
    """How much is collected in how many labs."""

    labs: int
    pushes: int  # of a session
    training: int  # of them
    repeated: int  # pushes that are made several times
    repeats: int
    counts: tuple[int, ...]  # training pushes of the learning curve


SIZES = {
    "quick": Sizes(2, 30, 20, 3, 3, (10, 20)),
    "paper": Sizes(5, 1500, 1200, 50, 10, (25, 50, 100, 200, 400, 800, 1200)),
}


def _mujoco(scope: Scope) -> None:
    if find_spec("mujoco") is None:
        raise missing_extra("The virtual lab needs MuJoCo", "mujoco")


MUJOCO: Need = _mujoco


class Collect(steps.Apart[Store]):
    """Pushes that the robot of a virtual lab records."""

    is_kept = True

    config: CollectConfig

    @property
    def name(self) -> str:
        """The lab and its surface."""
        again = "-repeated" if self.config.repeats > 1 else ""
        return f"lab-{self.config.lab}-{self.config.surface}{again}"

    def run(self, runner: "Runner") -> Store:
        """Return the dataset of the pushes without trouble."""
        with runner.bar(f"Pushing in {self.name}", self.config.pushes) as bar:
            return collect(self.config, runner.folder(self), on_pushes=bar.add)


class JoinLabs(steps.Step[Measurements]):
    """Measurements in several labs, each of which may have several parts."""

    parts: tuple[steps.Step[Measurements], ...]
    labs: tuple[int, ...]  # of the parts

    def run(self, runner: "Runner") -> Measurements:
        """Return the samples of all labs, each with the number of its lab."""
        found = map(runner.result, self.parts)
        return join([of_lab(m, lab) for m, lab in zip(found, self.labs, strict=True)])


def of_lab(measured: Measurements, lab: int) -> Measurements:
    """Return the same measurements, of one lab."""
    numbers = np.full(measured.data.sizes["sample"], lab, np.int32)
    data = measured.data.assign_coords(fold=("sample", numbers))
    return Measurements(data, structs.replace(measured.header, has_labs=True))


@dataclass(frozen=True)
class Lab:
    """One virtual lab in a study."""

    number: int
    scale: Scale

    @property
    def sizes(self) -> Sizes:
        """How much is collected."""
        return SIZES[self.scale]

    def pushes(self, surface: Surface = "abs") -> Collect:
        """Return the training and test pushes on a surface."""
        return Collect(self._config(surface, self.sizes.pushes))

    def repeated(self) -> Collect:
        """Return pushes that are made several times each, on ABS."""
        count, repeats = self.sizes.repeated, self.sizes.repeats
        return Collect(self._config("abs", count * repeats, seed=1, repeats=repeats))

    def tests(self, surface: Surface = "abs") -> steps.Rest:
        """Return the test pushes on a surface."""
        return steps.Rest(self.pushes(surface), self.sizes.training)

    def trained(self, count: int = 0, surface: Surface = "abs") -> "LabModels":
        """Return the models of so many training pushes on a surface; 0: of all."""
        count = count or self.sizes.training
        pushes = steps.First(self.pushes(surface), count)
        return LabModels(pushes, count, self)

    def _config(
        self, surface: Surface, pushes: int, *, seed: int = 0, repeats: int = 1
    ) -> CollectConfig:
        return CollectConfig(
            robot="lab",
            lab=self.number,
            surface=surface,
            pushes=pushes,
            seed=seed,
            repeats=repeats,
        )


@dataclass(frozen=True)
class LabModels:
    """The models that are made of some training pushes of a lab."""

    pushes: steps.Step[Store]
    count: int
    lab: Lab

    @property
    def identified(self) -> steps.Identify:
        """Physics with parameters identified on the pushes."""
        return steps.Identify(
            ModelId(kind="physics", simulator=IDENTIFIED), self.pushes
        )

    def tuned(self, variant: Variant) -> steps.Train:
        """Return a shipped network after fine-tuning on the pushes."""
        recipe = FINE_TUNING.changed(
            start=FromModel(variant.network), seed=self.lab.number
        )
        is_nominal = variant.engine == "nominal"
        return steps.Train(
            variant.identity(),
            self.pushes,
            scaled(recipe, self.lab.scale, self.count),
            None if is_nominal else self.identified,
        )

    def all(self) -> tuple[steps.Step[Model], ...]:
        """Return every model that the pushes were used for."""
        tuned = (self.tuned(variant) for variant in (*TUNED, AROUND_IDENTIFIED))
        return self.identified, *tuned


def shipped() -> tuple[steps.Step[Model], ...]:
    """Return what needs no pushes of a lab: physics, and networks of simulation."""
    return *physics(), steps.Load(IN, "in"), steps.Load(SAIN, "sain")


def labs(scale: Scale) -> Iterator[Lab]:
    """Yield the labs of a scale."""
    return (Lab(number, scale) for number in range(SIZES[scale].labs))


def _plan(scope: Scope) -> Plan:
    """Return the errors of physics on the test pushes of every lab and surface."""
    cases = list(product(labs(scope.scale), SURFACES))
    parts = tuple(
        steps.Evaluate(physics(), lab.tests(surface), condition_of(surface))
        for lab, surface in cases
    )
    return Plan(JoinLabs(parts, tuple(lab.number for lab, _ in cases)))


def condition_of(label: str, **factors: float | str) -> Condition:
    """Return a condition in the virtual lab."""
    return Condition(label=label, factors={"world": WORLD, **factors})


STUDY = Study(
    question="Virtual lab: what are the errors of physics on the collected pushes?",
    plan=_plan,
    needs=(MUJOCO,),
    figure=draw_errors,
)
