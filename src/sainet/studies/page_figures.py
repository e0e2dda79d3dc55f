"""Figures of the pages of results, and the pictures that explain the method."""

from collections.abc import Iterable
from pathlib import Path

from sainet.report.figures.episodes import draw_side_by_side
from sainet.report.figures.overview import Part, draw_errors_over_physics, draw_success
from sainet.report.pictures import draw_pictures
from sainet.studies import STUDIES, load_study
from sainet.studies.evidence import Evidence

# Conditions of the overviews: title, study, label.
_ERRORS_OF = (
    ("Table I: a force, two disks", "direct-force-two-disks", ""),
    ("Table II: three disks", "direct-force-three-disks", ""),
    ("Table III: the robot, two disks", "robot-two-disks", ""),
    ("Table IV, in the virtual lab", "lab-prediction", "tests on ABS"),
)
_SUCCESS_OF = (
    ("Simulation, easy goals", "simulated-control", "easy, greedy"),
    ("Simulation, hard goals", "simulated-control", "hard, greedy"),
    ("Simulation, three disks, easy goals", "control-any-number", "3 disks, easy"),
    ("Virtual lab, easy goals", "lab-control", "easy"),
    ("Virtual lab, hard goals", "lab-control", "hard"),
    ("The same, larger weight of alignment", "lab-control", "hard, alignment 10"),
)


def draw_figures(evidence: Evidence, figures: Path) -> None:
    """Draw overviews and figures of studies from measurements, and the pictures."""

    def parts(of: Iterable[tuple[str, str, str]]) -> list[Part]:
        return [Part(title, evidence.summary(name), label) for title, name, label in of]

    draw_errors_over_physics(parts(_ERRORS_OF), figures / "errors-over-physics.svg")
    draw_success(parts(_SUCCESS_OF), figures / "goals-solved.svg")
    for name in STUDIES:
        study = load_study(name)
        if study.figure is not None:
            study.figure(evidence.summary(name), figures / study.figure_name)
    for goal, records in evidence.episodes().items():
        draw_side_by_side(records, figures / f"episodes-{goal}.svg")
    draw_pictures(figures)
