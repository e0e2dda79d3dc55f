"""The paper's control table in simulation: success of each model on equal goals.

The world is Bullet with noise. Its disks differ from the assumed properties of the
internal engine, and all models face the same goals, tables and noise. Networks are the
shipped ones.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

from sainet.control.config import ControlConfig
from sainet.control.summary import MEASURES, paired_test, summarise
from sainet.control.trials import run_trials
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.published import SIMULATED_CONTROL

TRIALS = {"quick": 4, "paper": 100}
MODELS = ("physics", "physics-true", "in", "sain")
GOALS = ("easy", "hard")
PLANNERS = ("greedy", "tree")


@dataclass(frozen=True)
class Group:
    """A named condition of trials, run with every model."""

    name: str
    config: ControlConfig


def run(scale: Scale, chain: Chain) -> dict[str, Any]:
    """Return the table of all models and conditions.

    Args:
        scale: `paper` has 100 easy and 100 hard goals for each model and planner, and
            50 goals each with assumed properties and with a row of three disks.
        chain: runs the steps; finished episodes in its folder are kept.
    """
    rows, pairs = [], []
    for group in groups(TRIALS[scale]):
        records = {model: _trials(group, model, chain) for model in MODELS}
        named = {"group": group.name, "world": group.config.world}
        rows += [
            {**named, "model": model, **summarise(found)}
            for model, found in records.items()
        ]
        pairs += [
            {**named, "measure": measure, "model": other, "against": one}
            | paired_test(records[other], records[one], measure)
            for measure in MEASURES
            for one, other in combinations(MODELS, 2)
        ]
    table = {"rows": rows, "pairs": pairs, "published": list(SIMULATED_CONTROL)}
    return chain.finish(table)


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
