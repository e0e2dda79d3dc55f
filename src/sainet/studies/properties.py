"""Masses, radii and friction: varied or fixed in training, assumed or true in models.

The paper varies them in training, and lets the internal engine assume them (section
IV-C). Fixed properties are the assumed ones; nominal inputs of a network are the
assumed masses and radii in the place of the true ones.
"""

from msgspec import structs

from sainet.datasets.fixed import FixedConfig
from sainet.engines.simulator import SIMULATORS
from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.measurements import Condition
from sainet.models.identity import ModelId
from sainet.studies.paper_setup import IN, SAIN_BULLET
from sainet.studies.reduced_setup import ReducedSetup
from sainet.studies.steps import Join
from sainet.studies.study import Plan, Scope, Study

NETWORKS = (IN, SAIN_BULLET)
OF_FIXED = tuple(structs.replace(each, variant="fixed-properties") for each in NETWORKS)
SAIN_TRUE = ModelId(kind="sain", simulator=SIMULATORS["bullet-true"])
TRUE_INPUTS = (IN, SAIN_BULLET, SAIN_TRUE)
NOMINAL = tuple(structs.replace(each, features="nominal") for each in TRUE_INPUTS)
VARIED, FIXED = "varied properties", "fixed properties"  # of test pushes


def _varied_or_fixed(scope: Scope) -> Plan:
    """Return the errors of networks of either training on either kind of pushes."""
    reduced = ReducedSetup(scope)
    pushes = reduced.training_pushes("fixed", FixedConfig())
    networks = reduced.train(*NETWORKS) + reduced.train(*OF_FIXED, pushes=pushes)
    tests = {
        VARIED: reduced.test_pushes(),
        FIXED: reduced.test_pushes("fixed", FixedConfig()),
    }
    parts = (
        reduced.compare(
            networks, pushes, Condition(label=label, factors={"properties": label})
        )
        for label, pushes in tests.items()
    )
    return Plan(Join(tuple(parts)))


def _crossed(scope: Scope) -> Plan:
    """Return the errors of networks of either inputs without and around engines."""
    reduced = ReducedSetup(scope)
    networks = reduced.train(*TRUE_INPUTS, *NOMINAL)
    return Plan(reduced.compare(networks, reduced.test_pushes()))


def _less(text: str, model: ModelId, against: ModelId, *, where: str = "") -> Claim:
    return Claim(text, errs_less(model.slug, against.slug, condition=where))


def _trained_on(these: str, those: str) -> tuple[Claim, ...]:
    """Return that training on pushes like the test pushes is better."""
    pairs = zip(NETWORKS, OF_FIXED, strict=True)
    return tuple(
        _less(
            f"{name} trained on {these} errs less than on {those}, pushes of {these}",
            *(pair if these == VARIED else pair[::-1]),
            where=these,
        )
        for name, pair in zip(("IN", "SAIN around Bullet"), pairs, strict=True)
    )


_NAMES = ("IN", "SAIN", "SAIN around the engine with true properties")
VARIED_OR_FIXED = Study(
    question="Should networks be trained on varied or on fixed masses, radii and "
    "friction (section IV-C)?",
    plan=_varied_or_fixed,
    claims=_trained_on(VARIED, FIXED) + _trained_on(FIXED, VARIED),
)
CROSSED = Study(
    question="Where do true properties reduce errors: in the internal engine, or as "
    "inputs of the network?",
    plan=_crossed,
    claims=(
        *(
            _less(f"{name} errs less with true than with nominal inputs", one, other)
            for name, one, other in zip(_NAMES, TRUE_INPUTS, NOMINAL, strict=True)
        ),
        *(
            _less(
                f"SAIN with {inputs} inputs errs less around the engine with true "
                "properties than around that with assumed ones",
                around_true,
                around_assumed,
            )
            for inputs, (_, around_assumed, around_true) in (
                ("true", TRUE_INPUTS),
                ("nominal", NOMINAL),
            )
        ),
    ),
)
