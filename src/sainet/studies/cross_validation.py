"""Cross-validation: models fitted to some recorded pushes predict the others.

Everything that is fitted is fitted inside a fold: the identified parameters, the
scales of inputs and outputs, hyperparameters, weights, and the quantiles of regions. A
surface has models of its own, like a robot at one table.
"""

from collections.abc import Sequence
from dataclasses import replace

from msgspec import structs

from sainet.datasets import Scheme
from sainet.datasets.folds import folds_by
from sainet.datasets.splits import folds_of
from sainet.datasets.store import Store
from sainet.evaluation.evaluate import evaluate
from sainet.evaluation.joining import join
from sainet.evaluation.measurements import Condition, Measurements, read_measurements
from sainet.identification.identify import check_store as check_observed
from sainet.identification.identify import identify_into
from sainet.models.card import read_identified
from sainet.models.identity import ModelId
from sainet.models.library import load_model
from sainet.models.model import Model
from sainet.runs.errors import require
from sainet.studies.candidates import Candidate
from sainet.studies.recorded_models import IDENTIFIED, surfaces_of
from sainet.studies.recorded_pushes import JoinFolds
from sainet.studies.runner import Runner
from sainet.studies.steps import Apart, Given, Step
from sainet.studies.study import MEASUREMENTS, Scope

PHYSICS_IDENTIFIED = ModelId(kind="physics", simulator=IDENTIFIED)


class FitEngine(Apart[Model]):
    """Physics with parameters identified on some pushes."""

    is_kept = True

    pushes: Given

    @property
    def name(self) -> str:
        """What is done."""
        return "identify"

    def run(self, runner: Runner) -> Model:
        """Return the model, identified where that is unfinished."""
        folder = runner.folder(self)
        identify_into(self.pushes.store, folder)
        return replace(load_model(str(folder)), id=PHYSICS_IDENTIFIED)


class FitCandidate(Apart[Model]):
    """A candidate fitted to some pushes, around the engine identified on them."""

    is_kept = stays_with_inputs = True

    engine: FitEngine
    candidate: Candidate

    @property
    def name(self) -> str:
        """The name in tables."""
        return self.candidate.identity.slug

    def run(self, runner: Runner) -> Model:
        """Return the model, fitted where that is unfinished."""
        folder, pushes = runner.folder(self), self.engine.pushes.store
        identified = read_identified(runner.folder(self.engine))
        self.candidate.fit(pushes, identified.engine, folder)
        return replace(load_model(str(folder)), id=self.candidate.identity)


class EvaluateFitted(Apart[Measurements]):
    """Errors and regions of all models on pushes that they were not fitted to."""

    is_kept = stays_with_inputs = True

    engine: FitEngine
    fitted: tuple[FitCandidate, ...]
    pushes: Given
    condition: Condition

    @property
    def name(self) -> str:
        """What is done."""
        return "evaluate"

    def run(self, runner: Runner) -> Measurements:
        """Return the errors, measured where that is unfinished."""
        path = runner.folder(self) / MEASUREMENTS
        if not path.is_file():
            models = map(runner.result, (self.engine, *self.fitted))
            found = evaluate((load_model("physics"), *models), self.pushes.store)
            path.parent.mkdir(parents=True, exist_ok=True)
            found.write(path)
        return read_measurements(path).in_condition(self.condition)


class WithUnions(Step[Measurements]):
    """Measurements of all conditions, and of some of them together."""

    parts: tuple[Step[Measurements], ...]
    unions: tuple[Condition, ...]

    def run(self, runner: Runner) -> Measurements:
        """Return the measurements of all parts."""
        whole = join([runner.result(part) for part in self.parts])
        conditions = whole.header.conditions + self.unions
        header = structs.replace(whole.header, conditions=conditions)
        return replace(whole, header=header)


def fitted_and_tested(
    training: Store, tests: Store, condition: Condition, models: Sequence[Candidate]
) -> EvaluateFitted:
    """Return the step that fits the engine and models to pushes and tests them.

    Raises:
        BadStore: something cannot be fitted to these pushes.
        BadInput: the inputs of a model are the same in all of them.
    """
    check_observed(training)
    for each in models:
        each.check(training)
    engine = FitEngine(Given(training))
    fitted = tuple(FitCandidate(engine, each) for each in models)
    return EvaluateFitted(engine, fitted, Given(tests), condition)


def cross_validated(
    store: Store, schemes: Sequence[Scheme], count: int, models: Sequence[Candidate]
) -> WithUnions:
    """Return the measurements of each division and surface, and their unions.

    Args:
        store: recorded pushes.
        schemes: how they are divided into folds, each a condition.
        count: of the folds.
        models: to fit, beside the engine.

    Raises:
        BadStore: the pushes do not suffice for so many folds, or for a model.
        BadInput: the inputs of a model are the same in all pushes.
    """
    differ = 0 < len(schemes) == len(set(schemes))
    require(
        differ, "by", "one or more different divisions", " ".join(schemes) or "empty"
    )
    surfaces = surfaces_of(store)
    parts: list[Step[Measurements]] = []
    unions: list[Condition] = []
    for scheme in schemes:
        labels = {
            s: f"{scheme}, {s}" if len(surfaces) > 1 else scheme for s in surfaces
        }
        for surface, rows in surfaces.items():
            factors: dict[str, float | str] = {"folds": scheme, "surface": surface}
            condition = Condition(label=labels[surface], factors=factors)
            owner = folds_by(store, scheme, count, rows)
            folds = tuple(folds_of(store, rows, owner, count))
            tests = (
                fitted_and_tested(each.training, each.tests, condition, models)
                for each in folds
            )
            parts.append(JoinFolds(tuple(tests), folds, condition))
        if len(surfaces) > 1:
            unions.append(Condition(label=scheme, parts=tuple(labels.values())))
    return WithUnions(tuple(parts), tuple(unions))


def in_folds(
    scope: Scope, store: Store, schemes: Sequence[Scheme], models: Sequence[Candidate]
) -> WithUnions:
    """Return the measurements of divisions into folds, at the quick scale of one."""
    schemes, count = (schemes, 5) if scope.scale == "paper" else (schemes[:1], 2)
    return cross_validated(store, schemes, count, models)
