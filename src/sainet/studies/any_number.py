"""Any number of disks: what networks of two disks, or of one to four, predict of more.

Bullet is the truth. A contact network corrects the engine with the true masses and
radii; the paper's networks are trained on two disks by the recipe of Table III.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain, product

from msgspec import structs

from sainet.datasets.config import GenerateConfig
from sainet.datasets.store import Store
from sainet.engines.simulator import SIMULATORS
from sainet.evaluation.claims import TRUE_PROPERTIES, Claim, errs_less
from sainet.evaluation.margins import errs_at_most_more
from sainet.evaluation.measurements import Condition
from sainet.learning.recipes import CONTACT, Recipe
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.report.figures.counts import draw_errors_over_disks
from sainet.studies import Scale
from sainet.studies.paper_setup import (
    IN,
    SAIN,
    PaperSetup,
    chunk_of,
    in_batches,
    physics,
)
from sainet.studies.runner import Runner
from sainet.studies.steps import Evaluate, Join, Simulate, Step, Train
from sainet.studies.study import Plan, Scope, Study
from sainet.worlds.config import Arrangement

CONTACTS = ModelId(
    kind="sain",
    simulator=SIMULATORS["planar-true"],
    data="residual",
    features="contact",
)
MIXED = structs.replace(CONTACTS, variant="one-to-four")
# Around the engine with assumed properties, which moves disks apart or lets them be.
ASSUMED = structs.replace(CONTACTS, simulator=SIMULATORS["planar"])
OVERLAP = structs.replace(CONTACTS, simulator=SIMULATORS["planar-overlap"])
TRAINED = (1, 2, 3, 4)  # disks
TESTED = (2, 3, 5, 8)  # disks; two have one arrangement
# Of networks around it: disks, and recipes that were chosen on pushes of two and of
# three disks with other seeds. Disks begin and cease to move at other times than in the
# engine, so the residual changes from step to step.
OF_ASSUMED = TESTED[:3]
FOR_ASSUMED = CONTACT.changed(hold=1, l2=1e-4)
FOR_OVERLAP = FOR_ASSUMED.changed(iterations=3600, halve_every=1200)  # of one to four
ARRANGEMENTS: tuple[Arrangement, ...] = ("cluster", "row", "triangle")
GAPS_MM = (-2, -1, 0, 1, 2, 5)
# Training pushes of each number of disks, test pushes of each condition, iterations.
SIZES = {"quick": (48, 16, 10), "paper": (1500, 500, None)}
TRAININGS, OF_TABLE = 5, 3  # of contact networks, and of the paper's
_TRAINING_SEED, _TEST_SEED = 100, 200
_Condition = tuple[GenerateConfig, Condition]  # settings of the test pushes, and name


class TrainMixture(Train):
    """One training run of a network on datasets of several numbers of disks."""

    more: tuple[Step[Store], ...] = ()  # further training pushes

    def stores(self, runner: Runner) -> tuple[Store, ...]:
        """Return the training pushes, one dataset for each number of disks."""
        return tuple(runner.result(each) for each in (self.pushes, *self.more))


def _simulated(label: str, pushes: int, seed: int, config: GenerateConfig) -> Simulate:
    size = {"pushes": pushes, "seed": seed, "chunk_size": chunk_of(pushes)}
    inside = "planar", "planar-true"
    whole = replace(config, engine="bullet", assumed_engine=inside, **size)
    return Simulate(label, whole)


def training_pushes(scale: Scale, disks: int) -> Simulate:
    """Return the training pushes of a number of disks."""
    config = GenerateConfig(disks=disks)
    seed = _TRAINING_SEED + disks
    return _simulated(f"train-{disks}-disks", SIZES[scale][0], seed, config)


def test_pushes(scale: Scale, config: GenerateConfig, label: str) -> Simulate:
    """Return test pushes of a condition."""
    seed = _TEST_SEED + config.disks
    return _simulated(f"test-{label}", SIZES[scale][1], seed, config)


def of_two(
    scope: Scope, network: ModelId = CONTACTS, recipe: Recipe = CONTACT
) -> tuple[Train, ...]:
    """Return contact networks that are trained on pushes of two disks."""
    pushes = training_pushes(scope.scale, 2)
    return tuple(Train(network, pushes, each) for each in _recipes(scope, recipe))


def of_one_to_four(
    scope: Scope, network: ModelId = CONTACTS, recipe: Recipe = CONTACT
) -> tuple[TrainMixture, ...]:
    """Return contact networks that are trained on pushes of one to four disks."""
    first, *others = (training_pushes(scope.scale, disks) for disks in TRAINED)
    network = structs.replace(network, variant=MIXED.variant)
    return tuple(
        TrainMixture(network, first, each, more=tuple(others))
        for each in _recipes(scope, recipe)
    )


def _recipes(scope: Scope, recipe: Recipe = CONTACT) -> Iterator[Recipe]:
    iterations = SIZES[scope.scale][2] or recipe.optimiser.iterations
    recipe = in_batches(recipe, scope.scale, SIZES[scope.scale][0])
    for seed in scope.seeds(TRAININGS):
        yield recipe.changed(iterations=iterations, seed=seed)


def _models(scope: Scope) -> tuple[Step[Model], ...]:
    """Return physics, the paper's networks, and contact networks of two disks."""
    train, seeds = PaperSetup("robot", scope.scale).train, scope.seeds(OF_TABLE)
    return (*physics(), *train((IN, SAIN), seeds), *of_two(scope))


def _conditions(tested: tuple[int, ...] = TESTED) -> Iterator[_Condition]:
    """Yield the number and the arrangement of disks; two have one arrangement."""
    two, *more = tested
    of_two, of_more = product([two], ARRANGEMENTS[:1]), product(more, ARRANGEMENTS)
    for disks, arrangement in chain(of_two, of_more):
        label = f"{disks} disks" + f", {arrangement}" * (disks > two)
        factors: dict[str, float | str] = {"disks": disks, "arrangement": arrangement}
        config = GenerateConfig(disks=disks, arrangement=arrangement)
        yield config, Condition(label=label, factors=factors)


def _numbers(scope: Scope) -> Plan:
    """Return the errors against the number of disks, in each arrangement."""
    return _compare(scope, (*_models(scope), *of_one_to_four(scope)), _conditions())


def _assumed(scope: Scope) -> Plan:
    """Return the errors around the engine with assumed properties."""
    two = (of_two(scope, each, FOR_ASSUMED) for each in (ASSUMED, OVERLAP))
    recipes = (ASSUMED, FOR_ASSUMED), (OVERLAP, FOR_OVERLAP)
    mixed = (of_one_to_four(scope, *each) for each in recipes)
    models = (*physics(), physics("planar-overlap")[0], *chain(*two, *mixed))
    return _compare(scope, models, _conditions(OF_ASSUMED))


def _gaps(scope: Scope) -> Plan:
    """Return the errors of two disks against the gap between them at the start."""
    conditions = (
        (
            GenerateConfig(gap_mm=gap),
            Condition(label=f"gap of {gap} mm", factors={"gap_mm": gap}),
        )
        for gap in GAPS_MM
    )
    return _compare(scope, _models(scope), conditions)


def _compare(
    scope: Scope, models: tuple[Step[Model], ...], conditions: Iterable[_Condition]
) -> Plan:
    """Return the errors of models on test pushes of each condition."""
    parts = (
        Evaluate(models, test_pushes(scope.scale, config, named.label), named)
        for config, named in conditions
    )
    return Plan(Join(tuple(parts)))


_MARGIN, _HALF = 0.05, 0.5  # largest upper bound; columns that are clearly better


def _claims() -> Iterator[Claim]:
    """Yield claims about contact networks beside the engine inside them."""
    for disks in TESTED[1:]:
        where = f"{disks} disks, cluster"
        yield Claim(
            f"a contact network trained on two disks errs less than its engine, "
            f"{disks} disks",
            errs_less(CONTACTS.slug, TRUE_PROPERTIES, condition=where),
        )
    for disks, arrangement in product(TESTED[2:], ARRANGEMENTS):
        where = f"{disks} disks, {arrangement}"
        yield Claim(
            f"with {where}, a contact network trained on one to four disks has at "
            "least half of its errors clearly below those of its engine, and none over "
            f"{_MARGIN:.0%} above",
            errs_at_most_more(
                MIXED.slug, TRUE_PROPERTIES, _MARGIN, condition=where, less=_HALF
            ),
            margin=_MARGIN,
        )


NUMBERS = Study(
    question="Do networks trained on few disks predict pushes of more disks?",
    plan=_numbers,
    subject=TRUE_PROPERTIES,
    claims=tuple(_claims()),
    figure=draw_errors_over_disks,
)
ASSUMED_STUDY = Study(
    question="How much of the error of an engine with assumed properties does a "
    "contact network remove, with two disks and with more?",
    plan=_assumed,
    subject=structs.replace(OVERLAP, variant=MIXED.variant).slug,
)
GAPS = Study(
    question="How do errors depend on the gap between two disks at the start?",
    plan=_gaps,
    subject=TRUE_PROPERTIES,
)
