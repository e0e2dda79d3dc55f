"""Why IN and SAIN are level here: training by the letter of the paper, step by step.

By the letter a network takes the inputs of the paper's equations in SI units, along the
axes of the table, and its loss in metres has l2 of 1e-3. Our choices are then added one
at a time, until the recipe is the usual one. Bullet is the truth and the engine.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import get_args

from msgspec import structs

from sainet.datasets.config import GenerateConfig
from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.measurements import Condition
from sainet.learning.recipes import PAPER, Recipe
from sainet.models.identity import Features, ModelId, Variant
from sainet.studies import Scale
from sainet.studies.paper_setup import (
    IN,
    SAIN_BULLET,
    SIZES,
    Sizes,
    chunk_of,
    in_batches,
    physics,
)
from sainet.studies.paper_tables import PUBLISHED_DIRECT_FORCE_TWO_DISKS
from sainet.studies.steps import Evaluate, Join, Simulate, Train
from sainet.studies.study import Plan, Scope, Study
from sainet.worlds.noise import NoiseLevel

TRAININGS = 3  # of each network, at reduced size
NOISES = "no noise", "default noise", "paper-like noise"
_ALL_STEPS = 480  # of a push by a force
_TRAINING_SEED, _TEST_SEED = 0, 1


@dataclass(frozen=True)
class Stage:
    """Training by the letter with some of our choices."""

    label: str
    recipe: Recipe
    features: Features = "paper"
    variant: Variant = ""

    def networks(self) -> Iterator[ModelId]:
        """Yield IN and SAIN of this stage."""
        for network in (IN, SAIN_BULLET):
            yield structs.replace(network, features=self.features, variant=self.variant)


_METRES = PAPER.changed(terms="metres", l2=1e-3)
LETTER = Stage("letter", _METRES.changed(features="letter"), "letter")
USUAL = Stage("usual", PAPER)
CHAIN = (
    LETTER,
    Stage(
        "push frame", _METRES.changed(features="letter-push-frame"), "letter-push-frame"
    ),
    Stage("standardised inputs and outputs", _METRES, variant="loss-in-metres"),
    Stage("scaled loss", PAPER.changed(l2=1e-3), variant="large-l2"),
    USUAL,
)
# Of our choices the one that could matter most, alone.
LESS_L2 = Stage(
    "letter, l2 of 1e-6", LETTER.recipe.changed(l2=1e-6), "letter", "small-l2"
)


@dataclass(frozen=True)
class World:
    """Pushes by a force in one world, and how many are simulated and trained on."""

    label: str
    scale: Scale
    sizes: Sizes
    config: GenerateConfig = GenerateConfig()
    steps: int = PAPER.horizon.steps  # of each push, that are trained on and count

    def compare(
        self,
        stages: Sequence[Stage],
        seeds: Sequence[int],
        condition: Condition | None = None,
    ) -> Evaluate:
        """Return the errors of physics and of the networks of stages."""
        pushes = self._simulate("train", self.sizes.pushes, _TRAINING_SEED)
        tests = self._simulate("test", self.sizes.tests, _TEST_SEED)
        networks = [
            Train(network, pushes, self._recipe(stage).changed(seed=seed))
            for stage in stages
            for network in stage.networks()
            for seed in seeds
        ]
        models = (*physics("bullet"), *networks)
        return Evaluate(models, tests, condition, self.steps)

    def _recipe(self, stage: Stage) -> Recipe:
        recipe = in_batches(stage.recipe, self.scale, self.sizes.pushes)
        return recipe.changed(
            iterations=self.sizes.iterations,
            halve_every=max(self.sizes.iterations // 4, 1),
            steps=self.steps,
        )

    def _simulate(self, label: str, pushes: int, seed: int) -> Simulate:
        whole = replace(
            self.config,
            setup="direct-force",
            pushes=pushes,
            seed=seed,
            engine="bullet",
            assumed_engine=("bullet", "planar"),  # IN's statistics need planar
            chunk_size=chunk_of(pushes),
        )
        return Simulate(f"{self.label}-{label}", whole)


REDUCED = {"quick": Sizes(48, 16, 10), "paper": Sizes(1000, 500, 1000)}
# A world whose Physics row is near the published one (`published_physics`): the damper
# is so weak that the friction, which no model knows, decides how far disks move. That
# is twice the paper's stroke for disk 1.
WEAK_DAMPER = GenerateConfig(damping_n_s_m=100.0, force_n=3.5, gap_mm=-2.0)


def _chain(scope: Scope) -> Plan:
    """Return the errors of each stage, at reduced size and the default noise."""
    world = World("letter", scope.scale, REDUCED[scope.scale])
    return Plan(world.compare((*CHAIN, LESS_L2), scope.seeds(TRAININGS)))


def _noise(scope: Scope) -> Plan:
    """Return the errors of both ends of the chain, at full size, at each noise."""
    parts, sizes = [], SIZES if scope.scale == "paper" else REDUCED
    for level, label in zip(get_args(NoiseLevel), NOISES, strict=True):
        config = GenerateConfig(noise_level=level)
        world = World(f"letter-{level}", scope.scale, sizes[scope.scale], config)
        named = Condition(label=label, factors={"noise_level": level})
        parts.append(world.compare((LETTER, USUAL), range(1), named))
    return Plan(Join(tuple(parts)))


def _weak_damper(scope: Scope) -> Plan:
    """Return the errors of both ends where the friction decides, over all 2 s."""
    world = World(
        "weak-damper", scope.scale, REDUCED[scope.scale], WEAK_DAMPER, _ALL_STEPS
    )
    return Plan(world.compare((LETTER, USUAL), scope.seeds(TRAININGS)))


def sain_errs_less(stages: Sequence[Stage], condition: str = "") -> tuple[Claim, ...]:
    """Return the paper's thesis for each stage: SAIN errs less than IN."""
    where = f", {condition}" if condition else ""
    return tuple(
        Claim(
            f"SAIN errs less than IN, {stage.label}{where}",
            errs_less(augmented.slug, without.slug, condition=condition),
        )
        for stage in stages
        for without, augmented in [tuple(stage.networks())]
    )


CHAIN_STUDY = Study(
    question="Which of our choices close the gap between IN and SAIN?",
    plan=_chain,
    claims=sain_errs_less((*CHAIN, LESS_L2)),
    published=PUBLISHED_DIRECT_FORCE_TWO_DISKS,
)
NOISE_STUDY = Study(
    question="Are the errors of IN and SAIN equal at every noise, by the letter and as "
    "usual?",
    plan=_noise,
    claims=tuple(
        claim
        for noise, stage in product(NOISES, (LETTER, USUAL))
        for claim in sain_errs_less((stage,), noise)
    ),
)
WEAK_DAMPER_STUDY = Study(
    question="Do networks have the published errors in a setting where Physics does?",
    plan=_weak_damper,
    claims=sain_errs_less((LETTER, USUAL)),
    published=PUBLISHED_DIRECT_FORCE_TWO_DISKS,
)
