"""The paper's control table in simulation: success of each model on equal goals.

The world is Bullet with noise. Its disks differ from the assumed properties of the
internal engine, and all models face the same goals, tables and noise. Networks are the
shipped ones.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from sainet.control.config import ControlConfig
from sainet.control.record import EpisodeRecord
from sainet.control.trials import measure_trials, run_trials
from sainet.evaluation.claims import Claim, solves_more
from sainet.evaluation.measurements import Condition, Measurements, PublishedValues
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.studies.paper_setup import IN, SAIN, physics
from sainet.studies.runner import Bar, Runner
from sainet.studies.steps import Join, Load, Place, Step
from sainet.studies.study import Plan, Scope, Study

TRIALS = {"quick": (1, 2), "paper": (100, 60)}  # and the most pushes of each
_FEW = 4  # trials
MODELS = (*physics(), Load(IN, "in"), Load(SAIN, "sain"))
GOALS = ("easy", "hard")
PLANNERS = ("greedy", "tree")
_FACTORS = ("world", "goals", "planner", "given_properties")


class RunTrials(Step[Measurements]):
    """Control trials of models on the same goals."""

    is_kept = True

    models: tuple[Step[Model], ...]  # loaded by name, or made by a step
    config: ControlConfig  # of every model
    condition: Condition

    @property
    def name(self) -> str:
        """The condition."""
        return self.condition.label

    @property
    def place(self) -> Place:
        """Over all processes, each of which runs episodes; few in one."""
        return Place.APART if self.config.trials <= _FEW else Place.SPREAD

    def run(self, runner: Runner) -> Measurements:
        """Return the outcomes; finished episodes are kept."""
        records = {}
        for step in self.models:
            model = runner.result(step)
            source = model.name if isinstance(step, Load) else str(model.folder)
            config = replace(self.config, model=source)
            title = f"Pushing ({model.name}, {self.name})"
            with runner.bar(title, config.trials) as bar:
                solved: list[bool] = []
                records[model.id] = run_trials(
                    config,
                    runner.folder(self) / model.name,
                    executor=runner.executor,
                    on_episode=partial(_count, bar, solved),
                )
        return measure_trials(records, self.condition)


def _count(bar: Bar, solved: list[bool], record: EpisodeRecord) -> None:
    solved.append(record.solved)
    bar.add(1, f"{sum(solved)} solved")


def _plan(scope: Scope) -> Plan:
    """Return the trials of all models in every condition.

    At the scale `paper` these are 100 easy and 100 hard goals for each model and
    planner, and 50 hard goals with assumed properties. More disks have a study of
    their own, `control-any-number`.
    """
    return Plan(Join(tuple(trials(*TRIALS[scope.scale]))))


def trials(count: int, pushes: int) -> Iterator[RunTrials]:
    """Yield the conditions of the paper, then further ones."""
    usual = ControlConfig(world="bullet", trials=count, pushes=pushes)
    for planner in PLANNERS:
        for goals in GOALS:
            config = replace(usual, planner=planner, goals=goals)
            yield _trials(f"{goals}, {planner}", config)
    few = replace(usual, planner="tree", trials=max(count // 2, 1), goals="hard")
    nominal = replace(few, given_properties="assumed")
    yield _trials("hard, tree, nominal properties", nominal)


def _trials(label: str, config: ControlConfig) -> RunTrials:
    factors = {name: getattr(config, name) for name in _FACTORS}
    return RunTrials(MODELS, config, Condition(label=label, factors=factors))


def published_success(
    condition: str, model: ModelId, success: float
) -> PublishedValues:
    """Return the published share of solved trials of one model."""
    return PublishedValues(
        condition=condition, model=model, values={"success": (success,)}, trials=25
    )


# Of the paper (Ajay et al., ICRA 2019): Bullet's world, the paper's search.
PUBLISHED_SIMULATED_CONTROL = (
    published_success("easy, greedy", IN, 1.00),
    published_success("hard, greedy", IN, 0.88),
    published_success("easy, greedy", SAIN, 1.00),
    published_success("hard, greedy", SAIN, 1.00),
)
STUDY = Study(
    question="How many goals does each model solve, with the paper's search and with "
    "the tree search?",
    plan=_plan,
    claims=(
        Claim(
            "with the paper's search SAIN solves more hard goals than IN",
            solves_more("sain", "in", "hard, greedy"),
        ),
    ),
    published=PUBLISHED_SIMULATED_CONTROL,
)
