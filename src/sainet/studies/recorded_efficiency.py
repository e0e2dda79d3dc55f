"""How many recorded pushes of a surface a model needs: 25 to 400, cross-validated.

The smaller sets are parts of the greater ones. A surface with fewer pushes than a size
asks for gives all that it has.
"""

import numpy as np

from sainet.datasets.splits import Fold, fold_of_push, make_folds
from sainet.datasets.store import Store
from sainet.evaluation.joining import join, join_folds
from sainet.evaluation.summary import summarise
from sainet.report.figures.efficiency import draw_data_efficiency
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.data_efficiency import of_pushes
from sainet.studies.recorded_models import Tuner, Variant, surfaces_of
from sainet.studies.recorded_pushes import FOLDS, TOLD
from sainet.studies.result import Result

PUSHES = {"quick": (10, 20), "paper": (25, 50, 100, 200, 400)}
VARIANTS = (
    Variant("in", "tuned"),
    Variant("sain", "tuned"),
    Variant("sain", "tuned", "identified"),
    Variant("sain", "residual", "identified"),
)


def run(scale: Scale, chain: Chain) -> Result:
    """Tune on ever more recorded pushes; returns the table.

    Its groups are numbers of training pushes, over all surfaces together.

    Raises:
        BadInput: no recorded pushes were given.
    """
    store = chain.recorded_pushes()
    sizes = []
    for pushes in PUSHES[scale]:
        parts = []
        for surface, rows in surfaces_of(store).items():
            for fold in make_folds(store, FOLDS[scale], rows):
                folder = f"{pushes}/{surface}/fold-{fold.number}"
                tuner = Tuner(_first(fold, pushes), folder, scale, chain)
                models = [*tuner.physics(), *tuner.models(VARIANTS)]
                parts.append((fold, chain.compare(models, fold.tests)))
        sizes.append(join_folds(parts).in_condition(of_pushes(pushes)))
    found = join(sizes)
    summary = summarise(found, subject=TOLD)
    chain.finish(Result(summary=summary), measurements=found)
    draw_data_efficiency(summary, chain.out / "recorded-data-efficiency.svg")
    return Result(summary=summary)


def _first(fold: Fold, pushes: int) -> Store:
    """Return so many training pushes of a fold, repeats beside each other."""
    repeats = fold.training.repeats()
    kinds = fold_of_push(repeats, len(np.unique(repeats)), seed=fold.number)
    chosen = np.argsort(kinds, kind="stable")[:pushes]
    return fold.training.take(chosen)
