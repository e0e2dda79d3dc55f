"""Control in virtual labs: SAIN as trained in simulation, and fine-tuned on the lab.

Each lab has its own goals, starts and fine-tuned network. Both models face the same of
them. Whether a goal is reached is decided from the true pose. The further studies have
hard goals only: a surface that the network was not fine-tuned on, and exchanged disks,
whose assumed properties follow them or, in a second run, stay in their order.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from sainet.control.config import ControlConfig
from sainet.evaluation.claims import Claim, Verdict, solves_more
from sainet.evaluation.measurements import Condition
from sainet.evaluation.summary import Summary
from sainet.studies.lab_pushes import MUJOCO, SAIN_TUNED, WORLD, JoinLabs, Lab, labs
from sainet.studies.paper_setup import SAIN
from sainet.studies.recorded_models import Variant
from sainet.studies.simulated_control import RunTrials, published_success
from sainet.studies.steps import Load
from sainet.studies.study import Plan, Scope, Study

# Trials of each model and condition in every lab, and pushes of an episode.
TRIALS = {"quick": (1, 2), "paper": (20, 60)}
HARD = "hard"
ON_PLYWOOD = "hard, plywood"
SWAPPED = "hard, swapped disks"
BY_SLOT = "hard, swapped disks, properties in order"
_FACTORS = ("goals", "planner", "surface", "given_properties")
# Added after the other conditions were measured: in unsolved trials disk 2 drifted to
# one side of its goal, which the usual weight corrected too late.
STEERED = 10.0  # weight of the alignment in the heuristic (m); the usual one is 3


@dataclass(frozen=True)
class Case:
    """A condition of trials."""

    label: str
    config: ControlConfig

    def trials(self, lab: Lab) -> RunTrials:
        """Return the trials of both models in one lab."""
        count, pushes = TRIALS[lab.scale]
        config = replace(
            self.config, lab=lab.number, seed=lab.number, trials=count, pushes=pushes
        )
        tuned = lab.trained().tuned(Variant("sain", "tuned"))
        factors = {name: getattr(config, name) for name in _FACTORS}
        factors |= {"world": WORLD, "disks": "swapped" if config.swapped else "usual"}
        if config.alignment == STEERED:
            factors["alignment"] = STEERED
        condition = Condition(label=self.label, factors=factors)
        return RunTrials((Load(SAIN, "sain"), tuned), config, condition)


def _case(label: str, **settings: object) -> Case:
    usual = ControlConfig(robot="lab", goals="hard")
    return Case(label, replace(usual, **settings))


def _steered(case: Case) -> Case:
    """Return the same condition with a larger weight of the alignment."""
    label = f"{case.label}, alignment {STEERED:g}"
    return Case(label, replace(case.config, alignment=STEERED))


def _in_all_labs(*cases: Case) -> Callable[[Scope], Plan]:
    """Return the plan of some cases in every lab, with either weight."""
    every = (*cases, *map(_steered, cases))

    def plan(scope: Scope) -> Plan:
        found = [(lab, case) for lab in labs(scope.scale) for case in every]
        parts = tuple(case.trials(lab) for lab, case in found)
        return Plan(JoinLabs(parts, tuple(lab.number for lab, _ in found)))

    return plan


def solves_share(
    model: str, share: float, condition: str
) -> Callable[[Summary], Verdict]:
    """Return the rule that a model solves at least a share of the goals."""

    def rule(summary: Summary) -> Verdict:
        for row in summary.trials:
            if (row.model, row.condition) == (model, condition):
                return Verdict("holds" if row.success >= share else "does not hold")
        return Verdict("not testable here")

    return rule


_TUNED = SAIN_TUNED.slug
# Claims were declared before any trial in a lab. Published: Ajay et al., ICRA 2019.
CONTROL = Study(
    question="Virtual lab: does fine-tuning SAIN on pushes of the lab make it solve "
    "more goals there?",
    plan=_in_all_labs(_case("easy", goals="easy"), _case(HARD)),
    needs=(MUJOCO,),
    claims=(
        Claim(
            "in the virtual lab, fine-tuned SAIN solves more hard goals than SAIN "
            "trained in simulation",
            solves_more(_TUNED, SAIN.slug, HARD),
        ),
        Claim(
            "in the virtual lab, fine-tuned SAIN solves at least 98 of 100 hard goals",
            solves_share(_TUNED, 0.98, HARD),
        ),
    ),
    published=(
        published_success("easy", SAIN, 1.00),
        published_success(HARD, SAIN, 0.68),
        published_success("easy", SAIN_TUNED, 1.00),
        published_success(HARD, SAIN_TUNED, 0.96),
    ),
)
NEW_SURFACE = Study(
    question="Virtual lab: does SAIN, fine-tuned on ABS, solve hard goals on plywood?",
    plan=_in_all_labs(_case(ON_PLYWOOD, surface="plywood")),
    needs=(MUJOCO,),
    claims=(
        Claim(
            "in the virtual lab, SAIN fine-tuned on ABS solves at least 95 of 100 hard "
            "goals on plywood",
            solves_share(_TUNED, 0.95, ON_PLYWOOD),
        ),
    ),
    published=(published_success(ON_PLYWOOD, SAIN_TUNED, 0.92),),
)
SWAPPED_DISKS = Study(
    question="Virtual lab: does fine-tuned SAIN solve hard goals with the disks "
    "exchanged?",
    plan=_in_all_labs(
        _case(SWAPPED, swapped=True),
        _case(BY_SLOT, swapped=True, given_properties="assumed"),
    ),
    needs=(MUJOCO,),
    claims=(
        Claim(
            "in the virtual lab, fine-tuned SAIN solves at least 95 of 100 hard goals "
            "with swapped disks whose assumed properties follow them",
            solves_share(_TUNED, 0.95, SWAPPED),
        ),
    ),
    published=(published_success(SWAPPED, SAIN_TUNED, 0.88),),
)
