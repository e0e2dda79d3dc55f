"""Robustness to wrong properties and unseen conditions."""

from collections.abc import Iterator

import jax.numpy as jnp
import numpy as np

from sainet.datasets.config import GenerateConfig
from sainet.datasets.schema import Arrays
from sainet.datasets.store import Store
from sainet.evaluation.claims import Claim, errs_less
from sainet.evaluation.measurements import Condition
from sainet.scenes.geometry import wrap_angle
from sainet.studies.paper_setup import NETWORKS, PaperSetup
from sainet.studies.paper_tables import TRAININGS
from sainet.studies.steps import Derive, Join, Step
from sainet.studies.study import Plan, Scope, Study

PERCENT_WRONG = (2, 5, 10)
SPEEDS_MM_S = (25.0, 100.0)
GAP_MM = 2.0
# Pushes beyond 60 (contact) and 30 degrees (direction) are selected from these.
CONTACT_DEG, DIRECTION_DEG = 75.0, 45.0
_SEED = 11


class WrongProperties(Derive):
    """The same pushes with every mass and radius too large or too small."""

    percent: int

    @property
    def name(self) -> str:
        """The size of the errors."""
        return f"{self.pushes.name}-properties-{self.percent}-percent"

    def change(self, arrays: Arrays) -> Arrays:
        """Return the pushes with wrong masses and radii."""
        rng = np.random.default_rng(_SEED)
        wrong = {
            name: arrays[name]
            * (1 + self.percent / 100 * rng.choice([-1, 1], arrays[name].shape))
            for name in ("mass", "radius")
        }
        return arrays | wrong


class OutsideAngles(Derive):
    """The pushes outside the training range of angles."""

    @property
    def name(self) -> str:
        """The pushes."""
        return f"{self.pushes.name}-outside"

    def change(self, arrays: Arrays) -> Arrays:
        """Return the pushes beyond one of the largest angles."""
        contact, heading = push_angles(arrays)
        kept = (contact > np.deg2rad(60)) | (heading > np.deg2rad(30))
        return {name: array[kept] for name, array in arrays.items()}


def push_angles(arrays: Arrays) -> tuple[np.ndarray, np.ndarray]:
    """Return absolute contact angles and push directions of stored pushes (rad)."""
    place = arrays["initial"][:, :, :2]
    normal = place[:, 0] - arrays["initial_pusher"]
    way = arrays["command_position"][:, -1] - arrays["initial_pusher"]
    axis = place[:, 1] - place[:, 0]
    angles = [np.arctan2(*vector[:, ::-1].T) for vector in (axis, normal, way)]
    contact, heading = np.abs(wrap_angle(jnp.asarray(np.diff(angles, axis=0))))
    return contact, heading


def _plan(scope: Scope) -> Plan:
    """Return the networks of Table III on unseen conditions."""
    paper = PaperSetup("robot", scope.scale)
    networks = paper.train(NETWORKS, scope.seeds(TRAININGS))
    sets = unseen_sets(paper)
    return Plan(Join(tuple(paper.compare(networks, *each) for each in sets)))


def unseen_sets(paper: PaperSetup) -> Iterator[tuple[Step[Store], Condition]]:
    """Yield test pushes and their condition."""

    def condition(label: str, **factors: float | str) -> Condition:
        return Condition(label=label, factors=factors)

    usual = paper.test_pushes()
    yield usual, condition("as trained")
    for percent in PERCENT_WRONG:
        named = condition(f"properties ±{percent} %", percent_wrong=percent)
        yield WrongProperties(usual, percent), named
    wide = GenerateConfig(contact_angle_deg=CONTACT_DEG, direction_deg=DIRECTION_DEG)
    angles = OutsideAngles(paper.test_pushes("test-wide-angles", wide))
    yield angles, condition("angles outside", angles="outside")
    for speed in SPEEDS_MM_S:
        config = GenerateConfig(speed_mm_s=(speed,))
        named = condition(f"{speed:g} mm/s", speed_mm_s=speed)
        yield paper.test_pushes(f"test-{speed:g}-mm-s", config), named
    apart = f"{GAP_MM:g} mm apart"
    config = GenerateConfig(gap_mm=GAP_MM)
    yield paper.test_pushes(f"test-{apart}", config), condition(apart, gap_mm=GAP_MM)


STUDY = Study(
    question="How robust are models to wrong properties and unseen conditions?",
    plan=_plan,
    claims=(
        Claim(
            "SAIN errs less than Physics with masses and radii wrong by 10 %",
            errs_less("sain", "physics", condition="properties ±10 %"),
        ),
    ),
)
