"""The paper's two setups with Bullet as the truth: their pushes and networks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from msgspec import structs

from sainet.datasets.bystander import add_bystander
from sainet.datasets.config import GenerateConfig
from sainet.datasets.store import Store
from sainet.engines.simulator import SIMULATORS
from sainet.evaluation.measurements import Condition
from sainet.learning.recipes import FINE_TUNING, PAPER, Recipe
from sainet.models.identity import ModelId
from sainet.models.library import PHYSICS, physics_simulator
from sainet.studies import Scale, steps
from sainet.studies.runner import Runner
from sainet.worlds.config import SetupName

IN = ModelId(kind="in")
SAIN_BULLET, SAIN, SAIN_TRUE = (
    ModelId(kind="sain", simulator=SIMULATORS[name])
    for name in ("bullet", "planar", "planar-true")
)
NETWORKS = (IN, SAIN_BULLET, SAIN, SAIN_TRUE)
_QUICK_ITERATIONS = 10
_MANY, _CHUNK = 500, 16  # pushes
_QUICK_BATCH = 10  # pushes: of one size, whatever the data, to share compiled code
_TEST_SEED, _VALIDATION_SEED = 1, 2


@dataclass(frozen=True)
class Sizes:
    """How much is simulated and trained."""

    pushes: int
    tests: int
    iterations: int


SIZES = {"quick": Sizes(64, 16, 20), "paper": Sizes(4500, 500, 10_000)}


class WithBystander(steps.Apart[Store]):
    """The same pushes, beside each a disk that nothing touches."""

    is_kept = True

    pushes: steps.Step[Store]

    @property
    def name(self) -> str:
        """The pushes and the bystander."""
        return f"{self.pushes.name}-bystander"

    def run(self, runner: Runner) -> Store:
        """Return the dataset, predicted where that is unfinished."""
        store = runner.result(self.pushes)
        total = store.info.pushes * len(store.info.assumed_engines)
        with runner.bar(f"Predicting {self.name}", total) as bar:
            return add_bystander(store, runner.folder(self), on_pushes=bar.add)


def chunk_of(pushes: int) -> int:
    """Return the pushes in a chunk of a dataset: whole chunks are simulated at once.

    Datasets share compiled programs if their chunks are equal.
    """
    return 250 if pushes >= _MANY else min(_CHUNK, pushes)


@dataclass(frozen=True)
class PaperSetup:
    """One of the paper's setups at one scale."""

    setup: SetupName
    scale: Scale

    @property
    def sizes(self) -> Sizes:
        """How much is simulated and trained."""
        return SIZES[self.scale]

    @property
    def recipe(self) -> Recipe:
        """The paper's recipe, with the iterations of the scale."""
        return PAPER.changed(iterations=self.sizes.iterations)

    def training_pushes(self) -> steps.Simulate:
        """Return the training pushes, with the predictions of every internal engine."""
        names = ("bullet", "planar", "planar-true")
        config = GenerateConfig(pushes=self.sizes.pushes, assumed_engine=names)
        return self._simulate("train", config)

    def test_pushes(
        self, label: str = "test", config: GenerateConfig | None = None
    ) -> steps.Simulate:
        """Return the test pushes, or as many others with some other settings."""
        config = config or GenerateConfig()
        config = replace(config, pushes=self.sizes.tests, seed=_TEST_SEED)
        return self._simulate(label, config)

    def validation_pushes(self) -> steps.Simulate:
        """Return pushes to choose settings by: neither trained nor tested on."""
        config = GenerateConfig(pushes=self.sizes.tests, seed=_VALIDATION_SEED)
        return self._simulate("validation", config)

    def train(
        self,
        networks: Sequence[ModelId],
        seeds: Sequence[int],
        recipe: Recipe | None = None,
        *,
        pushes: int | None = None,
    ) -> tuple[steps.Train, ...]:
        """Return a training run of each network from each seed.

        Args:
            networks: some of `NETWORKS`, perhaps as another variant.
            seeds: of the training runs.
            recipe: by default the paper's.
            pushes: number of training pushes; None: all.
        """
        count, data = self.sizes.pushes, self.training_pushes()
        chosen: steps.Step[Store] = data
        if pushes not in (None, count):
            count, chosen = pushes, steps.First(data, pushes)
        recipe = in_batches(recipe or self.recipe, self.scale, count)
        return tuple(
            steps.Train(network, chosen, recipe.changed(seed=seed))
            for network in networks
            for seed in seeds
        )

    def train_beside_bystander(
        self, networks: Sequence[ModelId], seeds: Sequence[int]
    ) -> tuple[steps.Train, ...]:
        """Return networks that are fine-tuned beside a disk that nothing touches.

        By the recipe of fine-tuning any network, but for the steps, which are those of
        the network's own training.
        """
        pushes = WithBystander(self.training_pushes())
        recipe = FINE_TUNING.changed(steps=PAPER.horizon.steps)
        recipe = scaled(recipe, self.scale, self.sizes.pushes)
        return tuple(
            steps.Train(
                structs.replace(start.id, variant="bystander"),
                pushes,
                recipe.changed(seed=start.recipe.seed),
                start=start,
            )
            for start in self.train(networks, seeds)
        )

    def compare(
        self,
        networks: Sequence[steps.Train],
        tests: steps.Step[Store],
        condition: Condition | None = None,
    ) -> steps.Evaluate:
        """Return the errors of physics (Bullet) and networks."""
        return steps.Evaluate((*physics("bullet"), *networks), tests, condition)

    def _simulate(self, label: str, config: GenerateConfig) -> steps.Simulate:
        whole = replace(
            config,
            setup=self.setup,
            engine="bullet",
            chunk_size=chunk_of(config.pushes),
        )
        return steps.Simulate(f"{self.setup}-{label}", whole)


def physics(engine: str = "planar") -> tuple[steps.Load, ...]:
    """Return both physics models: assumed properties, and true masses and radii."""
    return tuple(
        steps.Load(
            ModelId(kind="physics", simulator=physics_simulator(name, engine)),
            name,
            engine,
        )
        for name in PHYSICS
    )


def scaled(recipe: Recipe, scale: Scale, pushes: int) -> Recipe:
    """Return a recipe for so many pushes: the quick scale has a few iterations."""
    recipe = in_batches(recipe, scale, pushes)
    quick = recipe.changed(iterations=_QUICK_ITERATIONS)
    return quick if scale == "quick" else recipe


def in_batches(recipe: Recipe, scale: Scale, pushes: int) -> Recipe:
    """Return a recipe whose batches have no more pushes than there are.

    At the quick scale they have no more than ten, whatever the data.
    """
    most = min(pushes, _QUICK_BATCH) if scale == "quick" else pushes
    return recipe.changed(batch_size=min(recipe.optimiser.batch_size, most))
