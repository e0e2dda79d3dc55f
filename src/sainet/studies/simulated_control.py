"""The paper's control table in simulation: success of each model on equal goals.

The world is Bullet with noise. Its disks differ from the assumed properties of the
internal engine, and all models face the same goals, tables and noise. Networks are the
shipped ones.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from sainet.control.config import ControlConfig
from sainet.control.measure import measure_trials
from sainet.control.trials import run_trials
from sainet.evaluation.conditions import Condition
from sainet.evaluation.joining import join
from sainet.evaluation.summary import summarise
from sainet.models.identity import identity_named
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.published import SIMULATED_CONTROL
from sainet.studies.result import Result

TRIALS = {"quick": 4, "paper": 100}
MODELS = ("physics", "physics-true", "in", "sain")
GOALS = ("easy", "hard")
PLANNERS = ("greedy", "tree")


@dataclass(frozen=True)
class Group:
    """A named condition of trials, run with every model."""

    name: str
    config: ControlConfig

    @property
    def condition(self) -> Condition:
        """The condition that its trials belong to."""
        names = ("world", "goals", "planner", "knows", "disks")
        factors = {name: getattr(self.config, name) for name in names}
        return Condition(label=self.name, factors=factors)


def run(scale: Scale, chain: Chain) -> Result:
    """Return the table of all models and conditions.

    Args:
        scale: `paper` has 100 easy and 100 hard goals for each model and planner, and
            50 goals each with assumed properties and with a row of three disks.
        chain: runs the steps; finished episodes in its folder are kept.
    """
    parts = []
    for group in groups(TRIALS[scale]):
        records = {
            identity_named(model): _trials(group, model, chain) for model in MODELS
        }
        parts.append(measure_trials(records, group.condition))
    found = join(parts).with_published(SIMULATED_CONTROL)
    return chain.finish(Result(summary=summarise(found)), measurements=found)


def groups(trials: int) -> Iterator[Group]:
    """Yield the conditions of the paper, then further ones."""
    usual = ControlConfig(world="bullet", trials=trials)
    for planner in PLANNERS:
        for goals in GOALS:
            config = replace(usual, planner=planner, goals=goals)
            yield Group(f"{goals}, {planner}", config)
    few = replace(usual, planner="tree", trials=max(trials // 2, 1))
    nominal = replace(few, goals="hard", knows="nominal")
    yield Group("hard, tree, nominal properties", nominal)
    yield Group("easy, tree, three disks", replace(few, goals="easy", disks=3))


def _trials(group: Group, model: str, chain: Chain) -> list[dict[str, Any]]:
    config, solved = replace(group.config, model=model), 0
    folder = f"{group.name.replace(', ', '-').replace(' ', '-')}-{model}"
    with chain.bar(f"Pushing ({model}, {group.name})", config.trials) as advance:

        def on_episode(record: dict[str, Any]) -> None:
            nonlocal solved
            solved += record["solved"]
            advance(1, f"{solved} solved")

        return run_trials(
            config,
            chain.out / folder,
            executor=chain.executor,
            on_episode=on_episode,
        )
