"""Closed loop: observe, plan, push, until the task is solved or no push is left."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from sainet.identification.adaptation import Adaptation
from sainet.models.library import Loadable, as_model
from sainet.planning.base import AbstractPlanner, Plan
from sainet.robots.base import AbstractRobot
from sainet.runs.errors import BadScene, Diverged, require
from sainet.scenes.pushes import Push
from sainet.scenes.recording import Recording
from sainet.scenes.scene import Scene, check_scene
from sainet.scenes.state import State
from sainet.tasks.push_to_goal import AbstractTask

SOLVED = "solved"  # why most episodes end
MOST_TROUBLES = 3  # in a row
# Largest differences between an executed push and the planned push.
_TOLERANCES = (
    ("contact_angle", np.deg2rad(5), "rad"),
    ("direction", np.deg2rad(5), "rad"),
    ("length", 1e-3, "m"),
    ("speed", 5e-3, "m/s"),
)


@dataclass(frozen=True)
class ControlStep:
    """One decision and its push.

    Attributes:
        observed: measured poses before the push.
        plan: the decision.
        recording: of the push.
        seconds: that the decision took.
        scene: properties that it was made with.
    """

    observed: State
    plan: Plan
    recording: Recording
    seconds: float
    scene: Scene


@dataclass
class Episode:
    """An episode of control.

    Attributes:
        steps: decisions and pushes, in order.
        final: the last observation.
        reason: why the episode ended: `solved`, `out of pushes`, or a failure.
    """

    steps: list[ControlStep] = field(default_factory=list)
    final: State | None = None
    reason: str = "interrupted"


def run_episode(
    robot: AbstractRobot,
    planner: AbstractPlanner,
    model: Loadable,
    task: AbstractTask,
    scene: Scene,
    *,
    pushes: int = 60,
    episode: Episode | None = None,
    adaptation: Adaptation | None = None,
    on_step: Callable[[ControlStep], None] = lambda step: None,
) -> Episode:
    """Return an episode, which ends when the task is solved or no push is left.

    Args:
        robot: observes and executes pushes.
        planner: selects pushes.
        model: predicts; as `load` takes it, by name for example, or its dynamics.
        task: task to solve.
        scene: properties given to model and task.
        pushes: maximum number of pushes.
        episode: filled during the episode, so that an interruption keeps its steps.
        adaptation: estimates properties from the pushes; replaces `model`, and the
            scene that plans are made with. None: the given properties stay.
        on_step: called after each push.

    Returns:
        The episode; its reason is `solved`, `out of pushes`, or the failure.

    Raises:
        BadScene: a property is out of its range.
        BadSetting: the planner is none, but a name for example.
    """
    check_scene(scene)
    wanted = "a planner, for example that of make_planner"
    require(hasattr(planner, "plan"), "planner", wanted, planner)
    given = as_model(model).dynamics, scene
    episode = episode or Episode()
    troubles = 0
    while True:
        episode.final = state = robot.observe()
        if bool(np.isfinite(state.position).all() and task.is_solved(scene, state)):
            return _end(episode, SOLVED)
        if len(episode.steps) == pushes:
            return _end(episode, _out_of_pushes(task, planner, episode, pushes))
        start = time.perf_counter()
        now = given if adaptation is None else adaptation.adapted(state)
        try:
            plan = planner.plan(now[0], task, now[1], state)
        except (BadScene, Diverged) as error:
            return _end(episode, f"planning failed: {error}")
        seconds = time.perf_counter() - start
        recording = checked(robot.push(plan.pushes[0]), plan.pushes[0])
        if adaptation is not None:
            adaptation.add(recording)
        episode.steps.append(ControlStep(state, plan, recording, seconds, now[1]))
        on_step(episode.steps[-1])
        troubles = troubles + 1 if recording.trouble else 0
        if troubles == MOST_TROUBLES:
            return _end(episode, f"{recording.trouble}, {troubles} times in a row")


def checked(recording: Recording, planned: Push) -> Recording:
    """Return the recording, with a trouble if its push differs from the planned push.

    The model predicted another push: its next prediction may be as wrong.
    """
    if recording.trouble:
        return recording
    # Of a source with two clocks, samples of one of them are NaN for the other.
    known = np.isfinite(recording.pose).all(axis=-1).any(axis=0)
    if not known.all() or np.isinf(recording.pose).any():
        return replace(recording, trouble="the recording contains NaN or infinity")
    executed = recording.commanded or planned
    for name, tolerance, unit in _TOLERANCES:
        off = abs(float(getattr(executed, name)) - float(getattr(planned, name)))
        if off > tolerance:
            return replace(
                recording,
                trouble="executed push differs from the planned push: its "
                f"{name.replace('_', ' ')} is off by {off:.3g} {unit}",
            )
    return recording


def _out_of_pushes(
    task: AbstractTask, planner: AbstractPlanner, episode: Episode, pushes: int
) -> str:
    """Return the reason of a truncated episode, and whether the goal was in reach."""
    reach = pushes * planner.actions.length
    away = float(task.distance(episode.steps[0].observed))
    if reach >= away:
        return "out of pushes"
    return (
        f"out of pushes: the goal was {1000 * away:.0f} mm away, and {pushes} x "
        f"{1000 * planner.actions.length:g} mm do not reach it"
    )


def _end(episode: Episode, reason: str) -> Episode:
    episode.reason = reason
    return episode
