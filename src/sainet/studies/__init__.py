"""Studies of the paper and beyond, the runner of their steps, and the demo."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from sainet.runs.names import load_named

if TYPE_CHECKING:
    from sainet.studies.study import Study

Scale = Literal["quick", "paper"]
# Learned models that a cross-validation compares, see `studies.candidates`.
CandidateName = Literal[
    "gp-angle",
    "gp-side",
    "gp-side-chosen",
    "gp-place",
    "gp-place-chosen",
    "sain",
    "sain-ensemble",
    "sain-place",
    "sain-place-ensemble",
]
USUAL_CANDIDATES: tuple[CandidateName, ...] = (
    *("sain", "gp-side", "sain-place", "gp-place"),
)
MEMBERS = 5  # of an ensemble among them


STUDIES = {
    "direct-force-two-disks": "sainet.studies.paper_tables:DIRECT_FORCE_TWO_DISKS",
    "direct-force-three-disks": "sainet.studies.paper_tables:DIRECT_FORCE_THREE_DISKS",
    "robot-two-disks": "sainet.studies.paper_tables:ROBOT_TWO_DISKS",
    "data-efficiency": "sainet.studies.data_efficiency:STUDY",
    "any-number": "sainet.studies.any_number:NUMBERS",
    "any-number-assumed": "sainet.studies.any_number:ASSUMED_STUDY",
    "gaps": "sainet.studies.any_number:GAPS",
    "published-physics": "sainet.studies.published_physics:STUDY",
    "letter": "sainet.studies.letter:CHAIN_STUDY",
    "letter-millimetres": "sainet.studies.letter_loss:MILLIMETRES_STUDY",
    "letter-scaled-loss": "sainet.studies.letter_loss:OUR_LOSS_STUDY",
    "letter-noise": "sainet.studies.letter:NOISE_STUDY",
    "letter-weak-damper": "sainet.studies.letter:WEAK_DAMPER_STUDY",
    "recurrent-or-not": "sainet.studies.variants:RECURRENT_OR_NOT",
    "regularisation": "sainet.studies.variants:REGULARISATION",
    "shorter-training": "sainet.studies.variants:SHORTER_TRAINING",
    "feedforward": "sainet.studies.feedforward:STUDY",
    "varied-or-fixed": "sainet.studies.properties:VARIED_OR_FIXED",
    "crossed-properties": "sainet.studies.properties:CROSSED",
    "robustness": "sainet.studies.robustness:STUDY",
    "simulated-control": "sainet.studies.simulated_control:STUDY",
    "control-any-number": "sainet.studies.control_any_number:STUDY",
    "control-in-the-way": "sainet.studies.control_any_number:IN_THE_WAY",
    "adaptation": "sainet.studies.adaptation:STUDY",
    "lab-adaptation": "sainet.studies.adaptation:NEW_SURFACE_STUDY",
    "expected-cost": "sainet.studies.expected_cost:STUDY",
    "engine-parity": "sainet.studies.engine_parity:STUDY",
    "robot-planar": "sainet.studies.paper_tables:ROBOT_PLANAR",
    "pretrained": "sainet.studies.pretrained:STUDY",
    "fine-tuning": "sainet.studies.fine_tuning:STUDY",
    "recorded-pushes": "sainet.studies.recorded_pushes:STUDY",
    "recorded-trust": "sainet.studies.recorded_trust:STUDY",
    "recorded-chosen": "sainet.studies.recorded_trust:CHOSEN_STUDY",
    "recorded-ensembles": "sainet.studies.recorded_ensembles:STUDY",
    "recorded-few": "sainet.studies.recorded_few:STUDY",
    "recorded-active": "sainet.studies.active_choice:RECORDED_STUDY",
    "lab-realism": "sainet.studies.lab_realism:STUDY",
    "lab-collect": "sainet.studies.lab_pushes:STUDY",
    "lab-prediction": "sainet.studies.lab_prediction:STUDY",
    "lab-active": "sainet.studies.active_choice:LAB_STUDY",
    "lab-control": "sainet.studies.lab_control:CONTROL",
    "lab-new-surface": "sainet.studies.lab_control:NEW_SURFACE",
    "lab-swapped-disks": "sainet.studies.lab_control:SWAPPED_DISKS",
}


def load_study(name: str) -> "Study":
    """Return a study.

    Raises:
        UnknownName: no study has this name.
    """
    return load_named("study", STUDIES, name)


@dataclass(frozen=True, kw_only=True)
class DemoConfig:
    """Size of the demo."""

    pushes: int = 1000
    """Number of training pushes."""
    test_pushes: int = 200
    """Number of test pushes."""
    iterations: int = 300
    """Number of iterations per network."""
    seed: int = 0
    """Random seed."""
