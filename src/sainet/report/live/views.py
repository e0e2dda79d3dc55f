"""Answers to the page; lengths in mm, angles in degrees, None for NaN and infinity."""

from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np
from jaxtyping import Float

from sainet.control.config import ControlConfig
from sainet.control.record import StepRecord, listed_poses
from sainet.control.trial import Trial
from sainet.control.worlds import WorldName, world_of
from sainet.report.live.predictions import STROKE, Difference, Path
from sainet.report.live.table import Table
from sainet.scenes.state import poses_of
from sainet.worlds.noise import NoiseLevel

Pose = list[float | None]  # x, y, angle


class DiskView(msgspec.Struct):
    """One disk of the world."""

    mass_kg: float
    radius_mm: float
    pose: Pose


class View(msgspec.Struct, tag="view", kw_only=True):
    """Everything that the page shows of the world."""

    world: WorldName
    noise: NoiseLevel
    model: str  # that plans
    disks: list[DiskView]
    target: int  # index of the target disk
    goal_mm: list[float]
    tolerance_mm: float
    distance_mm: float | None  # of the target disk from the goal
    is_solved: bool
    table_mm: list[list[float]]  # low and high corner
    pusher_radius_mm: float
    stroke_mm: float
    table_friction: float
    has_own_properties: bool  # masses, radii and friction can be changed
    pushes: int  # of the episode
    episodes: int  # with at least one push


class Ghost(msgspec.Struct):
    """Where a model predicts the disks after the push."""

    model: str
    pose: list[Pose]
    difference_mm: list[float]
    difference_deg: list[float]


class Ghosts(msgspec.Struct, tag="ghosts", kw_only=True):
    """The predictions of all models."""

    number: int  # of the message that asked
    against: str  # what differences are from: a model, or "world"
    reference: list[Pose]
    ghosts: list[Ghost]
    warnings: list[str] = []  # why predictions may be inaccurate
    blocked: str = ""  # why this push is impossible


class Moved(msgspec.Struct, tag="moved", kw_only=True):
    """An executed push, and how far predictions were off."""

    step: StepRecord
    ghosts: Ghosts
    view: View


def compared(
    paths: Mapping[str, Path],
    reference: Float[np.ndarray, "body 3"],
    **about: Any,  # noqa: ANN401
) -> Ghosts:
    """Return the final poses of predictions and their differences from a reference.

    Args:
        paths: predicted poses over the push, by model.
        reference: pose of each disk (m, m, rad).
        about: other fields of the answer.
    """
    ghosts: list[Ghost] = []
    for name, path in paths.items():
        difference = Difference.between(path[-1], reference)
        pose = listed_poses(path[-1])
        ghosts.append(Ghost(name, pose, difference.mm, difference.deg))
    return Ghosts(ghosts=ghosts, reference=listed_poses(reference), **about)


def view_of(
    trial: Trial, control: ControlConfig, table: Table, *, pushes: int, episodes: int
) -> View:
    """Return what the page shows of a trial."""
    task, scene, truth = trial.task, trial.robot.scene, trial.robot.truth
    world, radius = world_of(control), scene.radius.tolist()
    disks = zip(scene.mass.tolist(), radius, listed_poses(poses_of(truth)), strict=True)
    return View(
        world=world,
        noise=control.noise_level,
        model=control.model,
        disks=[
            DiskView(round(mass, 3), round(1000 * radius, 2), pose)
            for mass, radius, pose in disks
        ],
        target=task.moved,
        goal_mm=[round(1000 * x, 2) for x in task.goal.tolist()],
        tolerance_mm=1000 * task.tolerance * radius[task.moved],
        distance_mm=1000 * float(task.distance(truth)),
        is_solved=bool(task.is_solved(scene, truth)),
        table_mm=[[1000 * x for x in corner] for corner in (table.low, table.high)],
        pusher_radius_mm=1000 * float(scene.pusher_radius),
        stroke_mm=1000 * STROKE,
        table_friction=round(float(scene.table_friction), 3),
        has_own_properties=world != "lab",
        pushes=pushes,
        episodes=episodes,
    )
