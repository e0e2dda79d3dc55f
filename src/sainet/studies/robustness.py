"""Robustness to wrong properties and unseen conditions."""

from collections.abc import Iterator

import jax.numpy as jnp
import numpy as np

from sainet.datasets.derive import derive
from sainet.datasets.store import Store
from sainet.evaluation.conditions import Condition
from sainet.evaluation.joining import join
from sainet.evaluation.summary import summarise
from sainet.scenes.geometry import wrap_angle
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.studies.paper_setup import NETWORKS, PaperSetup, paper_setup
from sainet.studies.paper_tables import SEEDS
from sainet.studies.result import Result

PERCENT_WRONG = (2, 5, 10)
SPEEDS_MM_S = (25.0, 100.0)
GAP_MM = 2.0
# Pushes beyond 60 (contact) and 30 degrees (direction) are selected from these.
CONTACT_DEG, DIRECTION_DEG = 75.0, 45.0
_SEED = 11


def run(scale: Scale, chain: Chain) -> Result:
    """Return a table of the networks of Table III on unseen conditions."""
    setup = paper_setup("robot", scale, chain)
    trainings = setup.train(NETWORKS, SEEDS[scale])
    found = join(
        [
            setup.compare(trainings, tests, condition=condition)
            for condition, tests in _test_sets(setup)
        ]
    )
    return chain.finish(Result(summary=summarise(found)), measurements=found)


def _test_sets(setup: PaperSetup) -> Iterator[tuple[Condition, Store]]:
    def condition(label: str, **factors: float | str) -> Condition:
        return Condition(label=label, factors=factors)

    usual = setup.test_pushes()
    yield condition("as trained"), usual
    for percent in PERCENT_WRONG:
        named = condition(f"properties ±{percent} %", percent_wrong=percent)
        yield named, _misread(setup, usual, percent)
    yield condition("angles outside", angles="outside"), _outside_angles(setup)
    for speed in SPEEDS_MM_S:
        named = condition(f"{speed:g} mm/s", speed_mm_s=speed)
        name = f"test-{speed:g}-mm-s"
        yield named, setup.test_pushes(name, speed_mm_s=(speed,))
    named = condition(f"{GAP_MM:g} mm apart", gap_mm=GAP_MM)
    yield named, setup.test_pushes(f"test-{GAP_MM:g}-mm-apart", gap_mm=GAP_MM)


def _misread(setup: PaperSetup, usual: Store, percent: int) -> Store:
    """Return the test pushes with every mass and radius too large or too small."""

    def change(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        rng = np.random.default_rng(_SEED)
        wrong = {
            name: arrays[name]
            * (1 + percent / 100 * rng.choice([-1, 1], arrays[name].shape))
            for name in ("mass", "radius")
        }
        return arrays | wrong

    out = setup.chain.out / f"test-properties-{percent}-percent"
    return derive(usual, out, {"properties_wrong_percent": percent}, change)


def _outside_angles(setup: PaperSetup) -> Store:
    """Return pushes outside the training range, from a wider distribution."""
    wide = setup.test_pushes(
        "test-wide-angles", contact_angle_deg=CONTACT_DEG, direction_deg=DIRECTION_DEG
    )

    def change(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        contact, heading = push_angles(arrays)
        kept = (contact > np.deg2rad(60)) | (heading > np.deg2rad(30))
        return {name: array[kept] for name, array in arrays.items()}

    return derive(
        wide, setup.chain.out / "test-outside-angles", {"kept": "outside"}, change
    )


def push_angles(arrays: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return absolute contact angles and push directions of stored pushes (rad)."""
    place = arrays["initial"][:, :, :2]
    normal = place[:, 0] - arrays["initial_pusher"]
    way = arrays["command_position"][:, -1] - arrays["initial_pusher"]
    axis = place[:, 1] - place[:, 0]
    angles = [np.arctan2(*vector[:, ::-1].T) for vector in (axis, normal, way)]
    contact, heading = np.abs(wrap_angle(jnp.asarray(np.diff(angles, axis=0))))
    return contact, heading
