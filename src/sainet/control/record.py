"""Records of episodes as JSON: decisions, predictions and observations of each push."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from sainet.control.config import ControlConfig
from sainet.control.episode import Episode, Turn
from sainet.control.record_check import flaw
from sainet.control.trial import Trial
from sainet.runs.documents import read_json
from sainet.runs.errors import BadInput
from sainet.scenes.state import State

_EVERY = 8  # steps between the recorded poses of a path: 1/30 s


def record(
    config: ControlConfig, index: int, trial: Trial, episode: Episode
) -> dict[str, Any]:
    """Return the record of an episode; lengths in mm, angles in degrees.

    `solved` uses the true final pose, not the measured pose, which is noisy. NaN and
    infinity are None.
    """
    task, robot = trial.task, trial.robot
    final = 1000 * float(task.distance(robot.truth))
    told = {
        "trial": index,
        "model": config.model,
        "goals": config.goals,
        "reason": episode.reason,
        "solved": bool(task.is_solved(robot.scene, robot.truth)),
        "final_mm": final,
        "pushes": len(episode.turns),
        "final": _poses(poses_of(robot.truth)),
        "decision_s": [turn.seconds for turn in episode.turns],
        "goal_mm": _mm(task.goal),
        "moved": task.moved,
        "radius_mm": _mm(robot.scene.radius),
        "pusher_radius_mm": 1000 * float(robot.scene.pusher_radius),
        "tolerance_mm": 1000 * task.tolerance * float(robot.scene.radius[task.moved]),
        "table_friction": float(robot.scene.table_friction),
        "turns": [_turn(trial, turn) for turn in episode.turns],
    }
    return _finite_or_none(told)


def read_record(path: Path) -> dict[str, Any]:
    """Return the record of an episode.

    Raises:
        BadInput: the file is damaged or not an episode.
    """
    again = "delete it and run the same command to repeat this episode"
    try:
        found = read_json(path)
    except BadInput as error:
        raise BadInput(f"{error} Or {again}.") from None
    if wrong := flaw(found, path.stem):
        raise BadInput(f"{path}: not a valid episode, {wrong}; {again}.")
    return found


def _turn(trial: Trial, turn: Turn) -> dict[str, Any]:
    recording, plan = turn.recording, turn.plan
    push = recording.commanded or plan.pushes[0]
    return {
        "contact_angle_deg": _degrees(push.contact_angle),
        "direction_deg": _degrees(push.direction),
        "length_mm": 1000 * float(push.length),
        "speed_mm_s": 1000 * float(push.speed),
        "observed": _poses(poses_of(turn.observed)),
        "distance_mm": 1000 * float(trial.task.distance(turn.observed)),
        "planned_pushes": len(plan.pushes),
        "planned": _poses(plan.path[_EVERY - 1 :: _EVERY]),
        "planned_distance_mm": 1000 * plan.distance,
        "looked_at": plan.looked_at,
        "is_complete": plan.is_complete,
        "warnings": list(plan.warnings),
        "actual": _poses(recording.pose[_EVERY::_EVERY]),
        "pusher": _mm(recording.pusher[_EVERY::_EVERY]),
        "trouble": recording.trouble or None,
    }


def poses_of(state: State) -> np.ndarray:
    """Return the pose of each disk, ``[body, 3]`` (m, m, rad)."""
    return np.concatenate(
        [np.asarray(state.position), np.asarray(state.angle)[..., None]], axis=-1
    )


def _finite_or_none(value: Any) -> Any:  # noqa: ANN401
    """Return JSON values with null for NaN and infinity."""
    if isinstance(value, dict):
        return {name: _finite_or_none(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_finite_or_none(each) for each in value]
    is_lost = isinstance(value, float) and not math.isfinite(value)
    return None if is_lost else value


def _poses(pose: np.ndarray) -> list:
    """Return x and y in mm and the angle in degrees, rounded to 0.01."""
    units = np.array([1000, 1000, np.rad2deg(1)])
    return np.round(np.asarray(pose, np.float64) * units, 2).tolist()


def _mm(metres: object) -> list:
    return np.round(1000 * np.asarray(metres, np.float64), 2).tolist()


def _degrees(radians: object) -> float:
    return float(np.rad2deg(np.asarray(radians, np.float64)))
