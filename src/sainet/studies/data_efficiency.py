"""How many simulated pushes a network needs, alone and around an engine."""

from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.measurements import Condition
from sainet.learning.recipes import PAPER
from sainet.report.figures.curves import draw_data_efficiency
from sainet.studies.paper_setup import IN, SAIN, PaperSetup
from sainet.studies.steps import Evaluate, Join
from sainet.studies.study import Plan, Scope, Study

NETWORKS = (IN, SAIN)
PUSHES = {"quick": (32, 64), "paper": (50, 150, 500, 1500, 4500)}
TRAININGS, OTHER_TRAININGS = 3, 5  # of each network
AGAIN = {"quick": 64, "paper": 500}  # pushes, with other seeds
IN_FULL = Condition(
    label="all, trained in full", factors={"training_pushes": 4500, "iterations": "all"}
)
_SHORTER = 4


def _plan(scope: Scope) -> Plan:
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


STUDY = Study(
    question="How many simulated pushes does a network need, alone and around an "
    "engine?",
    plan=_plan,
    claims=(
        Claim(
            "with 50 training pushes SAIN errs less than IN",
            errs_less("sain", "in", condition=of_pushes(50).label),
        ),
    ),
    figure=draw_data_efficiency,
)
