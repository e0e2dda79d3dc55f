"""Comparisons of networks at reduced size: the robot setup, Bullet as truth.

Studies that ask how networks compare, and not how small errors become, train several of
each on fewer pushes and for fewer iterations, and share the runs.
"""

from dataclasses import dataclass, replace

from sainet.datasets.config import GenerateConfig
from sainet.datasets.store import Store
from sainet.evaluation.measurements import Condition
from sainet.learning.recipes import PAPER
from sainet.models.identity import ModelId
from sainet.studies.paper_setup import Sizes, chunk_of, in_batches, physics
from sainet.studies.steps import Evaluate, Simulate, Step, Train
from sainet.studies.study import Scope

SIZES = {"quick": Sizes(48, 16, 10), "paper": Sizes(1500, 500, 1500)}
TRAININGS = 3  # of each network
# With predictions in the datasets; planar is the default of networks without an engine.
ENGINES = ("planar", "bullet", "bullet-true")
_TRAINING_SEED, _TEST_SEED = 300, 400
_HALVINGS = 4  # of the learning rate, as in the paper's 10,000 iterations


@dataclass(frozen=True)
class ReducedSetup:
    """The robot setup at reduced size."""

    scope: Scope

    @property
    def sizes(self) -> Sizes:
        """How much is simulated and trained."""
        return SIZES[self.scope.scale]

    def training_pushes(
        self, label: str = "varied", config: GenerateConfig | None = None
    ) -> Simulate:
        """Return training pushes, by default the paper's."""
        return _simulate(f"train-{label}", self.sizes.pushes, _TRAINING_SEED, config)

    def test_pushes(
        self, label: str = "varied", config: GenerateConfig | None = None
    ) -> Simulate:
        """Return test pushes, by default the paper's."""
        return _simulate(f"test-{label}", self.sizes.tests, _TEST_SEED, config)

    def train(
        self, *networks: ModelId, pushes: Step[Store] | None = None
    ) -> tuple[Train, ...]:
        """Return the training runs of networks with the features of their identities.

        Args:
            networks: without or around engines of `ENGINES`.
            pushes: to train on; None: the paper's.
        """
        iterations = self.sizes.iterations
        recipe = in_batches(
            PAPER.changed(iterations=iterations, halve_every=iterations // _HALVINGS),
            self.scope.scale,
            self.sizes.pushes,
        )
        return tuple(
            Train(
                network,
                pushes or self.training_pushes(),
                recipe.changed(features=network.features, seed=seed),
            )
            for network in networks
            for seed in self.scope.seeds(TRAININGS)
        )

    def compare(
        self,
        networks: tuple[Train, ...],
        tests: Step[Store],
        condition: Condition | None = None,
    ) -> Evaluate:
        """Return the errors of physics (Bullet) and networks."""
        return Evaluate((*physics("bullet"), *networks), tests, condition)


def _simulate(
    label: str, pushes: int, seed: int, config: GenerateConfig | None
) -> Simulate:
    whole = replace(
        config or GenerateConfig(),
        pushes=pushes,
        seed=seed,
        engine="bullet",
        assumed_engine=ENGINES,
        chunk_size=chunk_of(pushes),
    )
    return Simulate(f"reduced-{label}", whole)
