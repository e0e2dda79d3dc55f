"""Robots that stand in for a real one: settings are chosen on their pushes.

Pushes and disk are those of the recorded ones, but simulated, with three times the
usual noise (the pusher does not tremble, see `strokes`), in all directions, and seen at
their ends alone. Ends scatter as widely as those of a recorded push made twice. Most of
that is the table: a smooth random function of where on it, in which direction and on
which of its sides the disk is pushed. The rest is chance, and one recording in twenty
fails: the disk is seen elsewhere than where it ended. What is to be told is where it
ended, so in tests nothing is left to chance.

The robots differ in what else the engine inside the model gets wrong. One has a
friction of contact that the engine does not know: nobody has identified it. The others
have been identified, and what is left no parameter of the engine explains: ends lie off
by smooth random functions of the angle at which the pusher meets the disk.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.special import j0

from sainet.datasets.derive import derive
from sainet.datasets.predictions import simulate
from sainet.datasets.schema import Arrays, StoreInfo, simulated_name
from sainet.datasets.store import Store
from sainet.engines.simulator import simulator_named
from sainet.studies.chain import Chain
from sainet.studies.strokes import STROKES

_FRICTION = 0.4  # of contact
_ENGINE = "planar"
_SPREAD = 0.028  # of the places on the table, standard deviation on each axis, m
# Standard deviations: along and across the push (m), and of the angle (rad). Table and
# chance together are what is left between recordings of one push on ABS at two speeds,
# whatever an identified engine says of them; what no parameter explains is of the size
# that the errors of such an engine have beyond that. What the table does, and what is
# unexplained, is of a disk that goes as far as the pusher: two thirds of it over all.
# The table's are those of random functions before their mean is taken off.
_UNEXPLAINED = np.array([0.0006, 0.0006, np.deg2rad(5.5)])
_TABLE = np.array([0.002, 0.002, np.deg2rad(7.0)])
_CHANCE = (0.0011, 0.0011, np.deg2rad(3.0))
_FAILED = 0.05  # share of the recordings that are trained on
_FAILED_BY = (0.01, 0.01, np.deg2rad(20))
_WAVES = 64  # of a random function
_WAVE_ANGLE = np.deg2rad(20)  # over which what is unexplained changes
_WAVE_LENGTH, _WAVE_TURN = 0.1, 2.0  # over which what the table does changes, m and rad
_PUSHER = ("initial_pusher", "command_position", "truth_pusher")
_PLACES, _HEIGHTS = 0x91ACE, 0x7AB1E  # streams of random numbers


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
        name: of the dataset; nothing is left to chance and none fails in `tests`.
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
        "unexplained_over": _WAVE_ANGLE,
        "table": [*_TABLE],
        "table_over": [_WAVE_LENGTH, _WAVE_TURN],
        "table_mean": 0,
        "spread": _SPREAD,
        "chance": [] if is_test else [*_CHANCE],
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
    arrays = placed(arrays, info.seed)
    off, seen_off = of_the_table(arrays), np.zeros((info.pushes, 3))
    if robot.unexplained is not None:
        off = off + unexplained(arrays, robot.unexplained)
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
    names = [f"simulated push {number}" for number in push]
    motion = simulate(simulator_named(_ENGINE), known, info, names)
    return known | {simulated_name(_ENGINE): motion}


def _at_all_steps(
    off: Float[np.ndarray, "push 3"],
) -> Float[np.ndarray, "push 1 1 3"]:
    """Return what is added to every pose of a push: its end alone is looked at."""
    return off[:, None, None].astype(np.float32)


def _recording_errors(info: StoreInfo) -> Float[np.ndarray, "push 3"]:
    """Draw by how much each end is seen elsewhere than where it was, m and rad."""
    rng = np.random.default_rng(info.seed)
    failed = rng.permutation(info.pushes) < round(_FAILED * info.pushes)
    sizes = np.where(failed[:, None], _FAILED_BY, _CHANCE)
    return sizes * rng.standard_normal((info.pushes, 3))


def placed(arrays: Arrays, seed: int | None) -> Arrays:
    """Return pushes that went from the origin as if made all over a table.

    Each is moved and turned as a whole, and its disk on itself.
    """
    rng = np.random.default_rng([_PLACES, seed or 0])
    count = len(arrays["steps"])
    place = _SPREAD * rng.standard_normal((count, 2))
    turn, own = rng.uniform(-np.pi, np.pi, (2, count))
    cosine, sine = np.cos(turn), np.sin(turn)
    matrix = np.stack([np.stack([cosine, sine], -1), np.stack([-sine, cosine], -1)], 1)

    def turned(name: str, first: int = 0) -> np.ndarray:
        array = arrays[name].astype(float)
        flat = array.reshape(count, -1, array.shape[-1])
        flat[..., first : first + 2] = flat[..., first : first + 2] @ matrix
        return array

    def moved(name: str) -> np.ndarray:
        array = turned(name)
        ones = [1] * (array.ndim - 2)
        array[..., :2] += place.reshape(count, *ones, 2)
        return array

    def of_disk(name: str) -> np.ndarray:
        array = moved(name)
        array[..., 2] += (turn + own).reshape(count, *[1] * (array.ndim - 2))
        return array

    arrays = arrays | {name: of_disk(name) for name in ("initial", "truth", "measured")}
    arrays |= {name: turned(name, 3) for name in ("initial", "truth")}
    arrays |= {name: moved(name) for name in _PUSHER}
    arrays["command_velocity"] = turned("command_velocity")
    return {
        name: array.astype(np.float32) if array.dtype == float else array
        for name, array in arrays.items()
    }


def unexplained(arrays: Arrays, seed: int) -> Float[np.ndarray, "push 3"]:
    """Return by how much ends lie off what any parameter says, m and rad.

    What is off along the push is the same for the mirrored push, what is off across it
    and in angle is opposite.
    """
    along, across, _ = _directions(arrays)
    normal = arrays["initial"][:, 0, :2] - arrays["initial_pusher"]
    angle = np.arctan2(np.sum(normal * across, -1), np.sum(normal * along, -1))
    rng = np.random.default_rng([seed, _WAVES])
    wave = rng.standard_normal((3, _WAVES)) / _WAVE_ANGLE
    height = rng.standard_normal((3, _WAVES)) * np.sqrt(2 / _WAVES)
    phases = angle[:, None, None] * wave
    waves = np.stack([np.cos(phases[:, 0]), *np.sin(phases[:, 1:]).swapaxes(0, 1)], 1)
    return _off(arrays, _UNEXPLAINED * np.sum(height * waves, axis=-1))


def of_the_table(arrays: Arrays) -> Float[np.ndarray, "push 3"]:
    """Return by how much the place on the table lets ends lie off, m and rad.

    Its mean over all places, directions and sides is zero: what is the same everywhere
    could be learned without knowing where.
    """
    along, _, _ = _directions(arrays)
    disk = arrays["initial"][:, 0, :3]
    own = np.stack([np.cos(disk[:, 2]), np.sin(disk[:, 2])], axis=-1)
    turns = np.concatenate([along, own], axis=-1) / _WAVE_TURN
    seen = np.concatenate([disk[:, :2] / _WAVE_LENGTH, turns], axis=-1)
    rng = np.random.default_rng([_HEIGHTS, _WAVES])
    wave = rng.standard_normal((3, _WAVES, seen.shape[1]))
    phase = rng.uniform(0, 2 * np.pi, (3, _WAVES))
    height = rng.standard_normal((3, _WAVES)) * np.sqrt(2 / _WAVES)
    waves = np.cos(np.einsum("kwn,pn->pkw", wave, seen) + phase)
    return _off(arrays, _TABLE * np.sum(height * (waves - _mean(wave, phase)), axis=-1))


def _mean(
    wave: Float[np.ndarray, "kind wave 6"], phase: Float[np.ndarray, "kind wave"]
) -> Float[np.ndarray, "kind wave"]:
    """Return the means of waves over normal places, and any direction and side."""
    place, along, own = (
        np.linalg.norm(wave[..., 2 * part : 2 * part + 2], axis=-1) for part in range(3)
    )
    faded = np.exp(-((_SPREAD / _WAVE_LENGTH * place) ** 2) / 2)
    return np.cos(phase) * faded * j0(along / _WAVE_TURN) * j0(own / _WAVE_TURN)


def _off(
    arrays: Arrays, size: Float[np.ndarray, "push 3"]
) -> Float[np.ndarray, "push 3"]:
    """Return x, y and angle of what is off along, across and in angle.

    A disk that is hardly moved is hardly moved elsewhere.
    """
    along, across, stroke = _directions(arrays)
    path = arrays["truth"][:, -1, 0, :2] - arrays["initial"][:, 0, :2]
    size = size * np.linalg.norm(path, axis=-1, keepdims=True) / stroke
    shift = size[:, :1] * along + size[:, 1:2] * across
    return np.concatenate([shift, size[:, 2:]], axis=-1)


def _directions(
    arrays: Arrays,
) -> tuple[np.ndarray, np.ndarray, Float[np.ndarray, "push 1"]]:
    """Return the directions along and across each push, and its length (m)."""
    push = arrays["command_position"][:, -1] - arrays["initial_pusher"]
    stroke = np.linalg.norm(push, axis=-1, keepdims=True)
    along = push / stroke
    return along, np.stack([-along[:, 1], along[:, 0]], axis=-1), stroke
