"""The networks that ship with the package: their training runs, and a check of them.

Weights from another machine or number of devices differ, so that the shipped networks
are training runs of their own. The paper's networks are those of Table III from seed 0.
Recorded pushes last up to 5 s, and a network trained only on the paper's, which last
0.2 s, diverges long before their end; the networks of long pushes are the shipped
networks of the paper, fine-tuned on simulated long pushes. The contact network of any
number of disks is that of the study `any-number` from seed 0, trained on one to four.
Whoever replaces one network replaces all, and the results of all.
"""

from dataclasses import replace

from msgspec import structs

from sainet.datasets.config import GenerateConfig
from sainet.datasets.surrogate import LONG_PUSHES
from sainet.engines.simulator import SIMULATORS
from sainet.evaluation.measurements import Condition
from sainet.learning.recipes import PAPER, FromModel
from sainet.models.identity import ModelId
from sainet.studies.any_number import MIXED, of_one_to_four, test_pushes
from sainet.studies.paper_setup import (
    IN,
    SAIN,
    SAIN_BULLET,
    PaperSetup,
    chunk_of,
    in_batches,
    physics,
)
from sainet.studies.steps import Evaluate, Join, Simulate, Train
from sainet.studies.study import Plan, Scope, Study

# Training pushes, test pushes, iterations.
SIZES = {"quick": (16, 16, 10), "paper": (LONG_PUSHES.pushes, 200, 3000)}
RECIPE = PAPER.changed(batch_size=50, halve_every=750, steps=10_000)
IN_LONG = ModelId(kind="in", data="stroke")
SAIN_ANY = structs.replace(MIXED, name="sain-any")
SAIN_LONG = ModelId(kind="sain", data="stroke", simulator=SIMULATORS["planar"])


def _plan(scope: Scope) -> Plan:
    paper = PaperSetup("robot", scope.scale)
    usual = paper.train((IN, SAIN, SAIN_BULLET), range(1))
    pushes, tests, iterations = SIZES[scope.scale]
    training = Simulate("long-train", _long_pushes(pushes, LONG_PUSHES.seed))
    recipe = in_batches(RECIPE, scope.scale, pushes)
    long = tuple(
        Train(
            identity,
            training,
            recipe.changed(start=FromModel(identity.kind), iterations=iterations),
        )
        for identity in (IN_LONG, SAIN_LONG)
    )
    long_tests = Simulate("long-test", _long_pushes(tests, LONG_PUSHES.seed + 1))
    own, other = Condition(label="robot"), Condition(label="long pushes")
    (contact, *_) = of_one_to_four(scope)
    any_number = replace(contact, id=SAIN_ANY)
    three = test_pushes(scope.scale, GenerateConfig(disks=3), "3 disks, cluster")
    measured = Join(
        (
            Evaluate((*physics(), *usual), paper.test_pushes(), own),
            Evaluate((*physics(), *long), long_tests, other, steps=0),
            Evaluate((*physics(), any_number), three, Condition(label="3 disks")),
        )
    )
    return Plan(measured, networks=(*usual, *long, any_number))


def _long_pushes(count: int, seed: int) -> GenerateConfig:
    return replace(LONG_PUSHES, pushes=count, seed=seed, chunk_size=chunk_of(count))


STUDY = Study(
    question="How accurate are the networks that ship with the package?", plan=_plan
)
