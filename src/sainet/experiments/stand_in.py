"""Robots that stand in for a real one: settings are chosen on their pushes.

Pushes and disk are those of the recorded ones, but simulated, with three times the
usual noise (the pusher does not tremble, see `strokes`), and seen at their ends alone.
Ends scatter as widely as those of a recorded push that was made twice, and one
recording in twenty fails: the disk is seen elsewhere than where it ended. What is to be
told is where it ended, so no test scatters or fails.

The robots differ in what the engine inside the model gets wrong. One has a friction of
contact that the engine does not know: nobody has identified it. The others have been
identified, and what is left no parameter of the engine explains: ends lie off by smooth
random functions of the angle at which the pusher meets the disk.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from sainet.datasets.derive import derive
from sainet.datasets.recorded import simulate
from sainet.datasets.schema import Arrays, StoreInfo, simulated_name
from sainet.datasets.store import Store
from sainet.experiments.chain import Chain
from sainet.experiments.strokes import STROKES

_FRICTION = 0.4  # of contact
_ENGINE = "planar"
# Standard deviations: along and across the push (m), and of the angle (rad). The
# scatter is what is left between recordings of one push on ABS at two speeds, whatever
# an identified engine says of them. What no parameter explains is for a disk that goes
# as far as the pusher, two thirds of it over all: of the size that the errors of such
# an engine have beyond the scatter.
_SCATTER = (0.0017, 0.0017, np.deg2rad(5.5))
_UNEXPLAINED = (0.0006, 0.0006, np.deg2rad(5.5))
_FAILED = 0.05  # share of the recordings that are trained on
_FAILED_BY = (0.01, 0.01, np.deg2rad(20))
_WAVES = 64  # of a random function
_WAVE_ANGLE = np.deg2rad(20)  # over which it changes


@dataclass(frozen=True)
class Robot:
    """What the engine inside the model gets wrong about a robot."""

    name: str
    believed_friction: float = _FRICTION
    unexplained: int | None = None  # which random functions, None: none at all


ROBOTS = (
    Robot("unidentified", believed_friction=0.25),
    Robot("identified-a", unexplained=0),
    Robot("identified-b", unexplained=1),
)


def recordings(robot: Robot, name: str, pushes: int, seed: int, chain: Chain) -> Store:
    """Return what was recorded of some pushes of a robot.

    Args:
        robot: that pushes.
        name: of the dataset; nothing scatters or fails in `tests`.
        pushes: how many.
        seed: of the pushes and of what fails.
        chain: in whose folder they are kept.
    """
    made = chain.simulate(
        f"{name}-simulated",
        replace(
            STROKES,
            pushes=pushes,
            chunk_size=pushes,
            seed=100 + seed,  # of none that a shipped network was trained on
            contact_friction=(_FRICTION,),
            speed_mm_s=(20.0,),
            hold_steps=0,
            noise_level="paper-like",
        ),
    )
    is_test = name == "tests"
    settings = {
        "believed_friction": robot.believed_friction,
        "observed": "ends",
        "unexplained": robot.unexplained,
        "unexplained_sizes": [*_UNEXPLAINED],
        "scatter": [] if is_test else [*_SCATTER],
        "failed": 0 if is_test else _FAILED,
    }
    return derive(
        made,
        chain.out / f"{name}-{robot.name}",
        settings,
        lambda arrays: _as_recorded(arrays, made.info, robot, is_test=is_test),
    )


def _as_recorded(
    arrays: Arrays, info: StoreInfo, robot: Robot, *, is_test: bool
) -> Arrays:
    """Return what is known of such pushes: the ends, and a friction."""
    push, last = np.arange(info.pushes), arrays["steps"] - 1
    off = seen_off = np.zeros((info.pushes, 3))
    if robot.unexplained is not None:
        off = unexplained(arrays, robot.unexplained)
    if not is_test:
        seen_off = _recording_errors(info)
    observed = np.zeros_like(arrays["pose_observed"])
    observed[push, last] = 1
    believed = np.full_like(arrays["pusher_friction"], robot.believed_friction)
    known = arrays | {
        "truth": arrays["truth"] + np.pad(_at_all_steps(off), [*[(0, 0)] * 3, (0, 3)]),
        "measured": arrays["measured"] + _at_all_steps(off + seen_off),
        "pusher_friction": believed,
        "disk_friction": believed,
        "pose_observed": observed,
        "rate_observed": np.zeros_like(observed),
    }
    return known | {simulated_name(_ENGINE): simulate(_ENGINE, known, info)}


def _at_all_steps(
    off: Float[np.ndarray, "push 3"],
) -> Float[np.ndarray, "push 1 1 3"]:
    return off[:, None, None].astype(np.float32)


def _recording_errors(info: StoreInfo) -> Float[np.ndarray, "push 3"]:
    """Draw by how much each end is seen elsewhere than where it was, m and rad."""
    rng = np.random.default_rng(info.seed)
    failed = rng.permutation(info.pushes) < round(_FAILED * info.pushes)
    sizes = np.where(failed[:, None], _FAILED_BY, _SCATTER)
    return sizes * rng.standard_normal((info.pushes, 3))


def unexplained(arrays: Arrays, seed: int) -> Float[np.ndarray, "push 3"]:
    """Return by how much ends lie off what any parameter says, m and rad.

    What is off along the push is the same for the mirrored push, what is off across it
    and in angle is opposite. A disk that is hardly moved is hardly moved elsewhere.
    """
    push = arrays["command_position"][:, -1] - arrays["initial_pusher"]
    stroke = np.linalg.norm(push, axis=-1, keepdims=True)
    push = push / stroke
    normal = arrays["initial"][:, 0, :2] - arrays["initial_pusher"]
    across = np.stack([-push[:, 1], push[:, 0]], axis=-1)
    angle = np.arctan2(np.sum(normal * across, -1), np.sum(normal * push, -1))
    rng = np.random.default_rng([seed, _WAVES])
    wave = rng.standard_normal((3, _WAVES)) / _WAVE_ANGLE
    height = rng.standard_normal((3, _WAVES)) * np.sqrt(2 / _WAVES)
    phases = angle[:, None, None] * wave
    waves = np.stack([np.cos(phases[:, 0]), *np.sin(phases[:, 1:]).swapaxes(0, 1)], 1)
    off = np.array(_UNEXPLAINED) * np.sum(height * waves, axis=-1)
    path = arrays["truth"][:, -1, 0, :2] - arrays["initial"][:, 0, :2]
    off *= np.linalg.norm(path, axis=-1, keepdims=True) / stroke
    shift = off[:, :1] * push + off[:, 1:2] * across
    return np.concatenate([shift, off[:, 2:]], axis=-1)
