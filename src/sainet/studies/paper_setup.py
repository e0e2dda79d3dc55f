"""The paper's two setups with Bullet as the truth: data and networks, made once.

All experiments of one setup and scale share one folder, so that what one has
simulated or trained, no other makes again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sainet.datasets.bystander import add_bystander
from sainet.datasets.config import GenerateConfig
from sainet.datasets.store import Store
from sainet.evaluation.conditions import Condition
from sainet.evaluation.measurements import Measurements
from sainet.learning.recipes import FINE_TUNING, PAPER, FromModel, Recipe
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.trainings import Training, scaled
from sainet.worlds.config import SetupName

AROUND = {
    "sain-bullet": "bullet",
    "sain": "planar",
    "sain-true": "planar-true",
}
NETWORKS = ("in", *AROUND)
BYSTANDER = "bystander"  # what networks are called that went on beside one
_CHUNK = 250  # pushes
_TEST_SEED, _VALIDATION_SEED = 1, 2


@dataclass(frozen=True)
class Sizes:
    """How much is simulated and trained."""

    pushes: int
    tests: int
    iterations: int


SIZES = {"quick": Sizes(500, 100, 300), "paper": Sizes(4500, 500, 10_000)}


@dataclass(frozen=True)
class PaperSetup:
    """One of the paper's setups at one scale."""

    setup: SetupName
    scale: Scale
    chain: Chain  # of the shared folder

    @property
    def sizes(self) -> Sizes:
        """How much is simulated and trained."""
        return SIZES[self.scale]

    def training_pushes(self) -> Store:
        """Return the pushes that networks are trained on, every s-bar with them."""
        around = tuple(AROUND.values())
        return self._simulate("train", self.sizes.pushes, assumed_engine=around)

    def test_pushes(self, name: str = "test-2-disks", **changes: Any) -> Store:  # noqa: ANN401
        """Return the test pushes, or others of the same number with other settings."""
        return self._simulate(name, self.sizes.tests, seed=_TEST_SEED, **changes)

    def validation_pushes(self) -> Store:
        """Return pushes to choose settings by: neither trained nor tested on."""
        return self._simulate("validation", self.sizes.tests, seed=_VALIDATION_SEED)

    def training_pushes_with_bystander(self) -> Store:
        """Return the same pushes, beside each a disk that nothing touches."""
        store, name = self.training_pushes(), "train-bystander"
        total = store.info.pushes * len(store.info.assumed_engines)
        with self.chain.bar(f"Predicting s-bar of {name}", total) as advance:
            return add_bystander(
                store, self.chain.out / name, on_pushes=lambda n: advance(n, "")
            )

    def train(
        self,
        names: Sequence[str],
        seeds: Sequence[int],
        *,
        form: str = "",
        pushes: int | None = None,
        **changes: Any,  # noqa: ANN401
    ) -> dict[str, list[str]]:
        """Train some of `NETWORKS`; returns the names of each one's folders.

        Args:
            names: of the networks.
            seeds: a training of each network for each.
            form: of the training, where it is not the usual one: goes into the names.
            pushes: how many of the training pushes to use; None is all.
            changes: settings of the training that are not the paper's.
        """
        count = self.sizes.pushes if pushes is None else pushes
        size = min(PAPER.optimiser.batch_size, count)
        usual = PAPER.changed(iterations=self.sizes.iterations, batch_size=size)
        store, recipe = self.training_pushes().first(count), usual.changed(**changes)
        return self.chain.train_seeds(
            {name: self._training(name, store, recipe, form) for name in names}, seeds
        )

    def train_beside_bystander(
        self, names: Sequence[str], seeds: Sequence[int]
    ) -> dict[str, list[str]]:
        """Let trained ones of `NETWORKS` go on, beside a disk that nothing touches.

        With the settings that hold for going on from any network, but for the steps,
        which are those that the network was trained on.
        """
        store = self.training_pushes_with_bystander()
        usual = FINE_TUNING.changed(steps=PAPER.horizon.steps)
        usual = scaled(usual, self.scale, store.info.pushes)
        trainings = {}
        for name in names:
            recipe = usual.changed(start=FromModel(str(self.chain.out / name)))
            trainings[name] = self._training(name, store, recipe, BYSTANDER)
        return self.chain.train_seeds(trainings, seeds)

    def _training(self, name: str, store: Store, recipe: Recipe, form: str) -> Training:
        return Training(
            "in" if name == "in" else "sain",
            store,
            recipe,
            self.chain.out / with_form(name, form),
            AROUND.get(name, "planar"),
        )

    def compare(
        self,
        trainings: Mapping[str, Sequence[str]],
        tests: Store,
        *,
        condition: Condition | None = None,
    ) -> Measurements:
        """Measure physics (Bullet) and networks, in one condition if it is given."""
        found = self.chain.compare_trainings(trainings, tests, engine="bullet")
        return found if condition is None else found.in_condition(condition)

    def _simulate(self, name: str, pushes: int, **changes: Any) -> Store:  # noqa: ANN401
        config = GenerateConfig(
            setup=self.setup,
            pushes=pushes,
            engine="bullet",
            chunk_size=min(_CHUNK, pushes),  # whole chunks are simulated
            **changes,
        )
        return self.chain.simulate(name, config)


def with_form(name: str, form: str) -> str:
    """Return what a network is called whose training has a form of its own."""
    return "-".join(part for part in (name, form) if part)


def paper_setup(setup: SetupName, scale: Scale, chain: Chain) -> PaperSetup:
    """Return a setup whose folder lies beside that of the experiment."""
    shared = replace(chain, out=chain.out.parent / f"{setup}-{scale}")
    return PaperSetup(setup, scale, shared)
