"""How many pushes a network needs: simulated ones, and recorded ones."""

import numpy as np

from sainet.datasets.splits import Fold, fold_of_push, make_folds
from sainet.datasets.store import Store
from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.measurements import Condition
from sainet.learning.recipes import PAPER
from sainet.report.figures.curves import draw_data_efficiency
from sainet.studies.paper_setup import IN, SAIN, PaperSetup
from sainet.studies.recorded_models import TunedModels, Variant, surfaces_of
from sainet.studies.recorded_pushes import FOLDS, SUBJECT, JoinFolds
from sainet.studies.steps import Evaluate, Given, Join
from sainet.studies.study import RECORDED as RECORDED_PUSHES
from sainet.studies.study import Plan, Scope, Study

NETWORKS = (IN, SAIN)
PUSHES = {"quick": (32, 64), "paper": (50, 150, 500, 1500, 4500)}
TRAININGS, OTHER_TRAININGS = 3, 5  # of each network
AGAIN = {"quick": 64, "paper": 500}  # pushes, with other seeds
IN_FULL = Condition(
    label="all, trained in full", factors={"training_pushes": 4500, "iterations": "all"}
)
_SHORTER = 4
RECORDED_COUNTS = {"quick": (10, 20), "paper": (25, 50, 100, 200, 400)}
VARIANTS = (
    Variant("in", "tuned"),
    Variant("sain", "tuned"),
    Variant("sain", "tuned", "identified"),
    Variant("sain", "residual", "identified"),
)


def _simulated(scope: Scope) -> Plan:
    """Return IN and SAIN, trained on ever more pushes of the robot setup.

    Every size has a quarter of the iterations, so that only the data differ: at the
    paper's scale these are still 55 passes over 4,500 pushes. The networks of Table
    III, which had all iterations, have a condition of their own, outside the figure. So
    have further training runs on 500 pushes: in each of the first three the network
    around an engine was better than alone, and three are too few for a conclusion.
    """
    paper = PaperSetup("robot", scope.scale)
    shorter = paper.recipe.changed(
        iterations=max(paper.sizes.iterations // _SHORTER, 1),
        halve_every=PAPER.optimiser.halve_every // _SHORTER,
    )

    def measure(
        condition: Condition, seeds: range, pushes: int | None = None
    ) -> Evaluate:
        recipe = shorter if pushes else paper.recipe
        networks = paper.train(NETWORKS, seeds, recipe, pushes=pushes)
        return paper.compare(networks, paper.test_pushes(), condition)

    seeds = scope.seeds(TRAININGS)
    others = scope.seeds(OTHER_TRAININGS, first=TRAININGS)
    parts = [measure(of_pushes(n), seeds, n) for n in PUSHES[scope.scale]]
    number = AGAIN[scope.scale]
    again = measure(of_pushes_again(number), others, number)
    return Plan(Join((*parts, again, measure(IN_FULL, seeds))))


def of_pushes(count: int) -> Condition:
    """Return the condition of a number of training pushes."""
    return Condition(label=f"{count:,}", factors={"training_pushes": count})


def of_pushes_again(count: int) -> Condition:
    """Return the condition of a number of training pushes, with other seeds."""
    factors: dict[str, float | str] = {"training_pushes": count, "seeds": "other"}
    return Condition(label=f"{count:,}, other trainings", factors=factors)


def _recorded(scope: Scope) -> Plan:
    """Return models tuned on ever more recorded pushes of a surface, cross-validated.

    The smaller sets are parts of the larger ones. A surface with fewer pushes than a
    size requires gives all of them.
    """
    store, sizes = scope.recorded_pushes(), []
    for pushes in RECORDED_COUNTS[scope.scale]:
        folds, parts = [], []
        for rows in surfaces_of(store).values():
            for fold in make_folds(store, FOLDS[scope.scale], rows):
                tuned = TunedModels(first_pushes(fold, pushes), scope.scale)
                models = (*tuned.physics(), *map(tuned.model, VARIANTS))
                folds.append(fold)
                parts.append(Evaluate(tuple(models), Given(fold.tests)))
        sizes.append(JoinFolds(tuple(parts), tuple(folds), of_pushes(pushes)))
    return Plan(Join(tuple(sizes)))


def first_pushes(fold: Fold, pushes: int) -> Store:
    """Return so many training pushes of a fold, repeats beside each other."""
    repeats = fold.training.repeats()
    kinds = fold_of_push(repeats, len(np.unique(repeats)), seed=fold.number)
    chosen = np.argsort(kinds, kind="stable")[:pushes]
    return fold.training.take(chosen)


SIMULATED = Study(
    question="How many simulated pushes does a network need, alone and around an "
    "engine?",
    plan=_simulated,
    claims=(
        Claim(
            "with 50 training pushes SAIN errs less than IN",
            errs_less("sain", "in", condition=of_pushes(50).label),
        ),
    ),
    figure=draw_data_efficiency,
    figure_name="data-efficiency.svg",
)
RECORDED = Study(
    question="How many recorded pushes of a surface does a model need?",
    plan=_recorded,
    needs=(RECORDED_PUSHES,),
    subject=SUBJECT,
    figure=draw_data_efficiency,
    figure_name="recorded-data-efficiency.svg",
)
