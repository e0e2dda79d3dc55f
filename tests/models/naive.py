"""The paper's equations 4 to 12 as plain loops over pushes, steps and pairs of bodies.

Everything is double precision and nothing is shared with the package but the arrays.
"""

from dataclasses import dataclass

import numpy as np

from sainet.models.blocks import RelativePose
from sainet.models.integrators import RelaxingResidual
from sainet.scenes.controls import PathControls

BOUND = 4.0  # standard deviations, that a feature is bent to


@dataclass
class LocalPush:
    """One push in the frame of its contact normal."""

    mass: np.ndarray
    radius: np.ndarray
    pusher_radius: float
    pushed: int
    angle: float  # of the frame
    origin: np.ndarray
    start: np.ndarray  # [body, 6]
    action: np.ndarray  # [time, 2 or 4]
    pusher: np.ndarray | None  # [time, 2], of a robot


def double(values) -> np.ndarray:
    return np.asarray(values, np.float64)


def turned(vector, angle) -> np.ndarray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine], [sine, cosine]]) @ vector


def nearest_disk(scene, state, push: int) -> int:
    gaps = [
        np.hypot(*(double(place) - double(state.pusher_position[push]))) - radius
        for place, radius in zip(
            state.position[push], double(scene.radius[push]), strict=True
        )
    ]
    return int(np.argmin(gaps))


def local_push(scene, state, controls, push: int, *, turns: bool = True) -> LocalPush:
    """Inputs of the network for one push of a batch, in the push frame if it turns."""
    pushed = nearest_disk(scene, state, push)
    origin = double(state.position[push, pushed])
    normal = origin - double(state.pusher_position[push])
    angle = np.arctan2(normal[1], normal[0]) if turns else 0.0
    local = LocalPush(
        mass=double(scene.mass[push]),
        radius=double(scene.radius[push]),
        pusher_radius=float(scene.pusher_radius[push]),
        pushed=pushed,
        angle=angle,
        origin=origin,
        start=np.zeros(0),
        action=_action(controls, push, angle),
        pusher=None,
    )
    local.start = to_local(local, motion_of(state, push))
    if isinstance(controls, PathControls):
        path = double(controls.position[push])
        local.pusher = np.array([turned(p - origin, -angle) for p in path])
    return local


def _action(controls, push: int, angle: float) -> np.ndarray:
    if isinstance(controls, PathControls):
        return np.array([turned(v, -angle) for v in double(controls.velocity[push])])
    offset = turned(double(controls.contact_offset[push]), -angle)
    force = double(controls.force[push])
    return np.array([np.concatenate([turned(f, -angle), offset]) for f in force])


def motion_of(state, push: int) -> np.ndarray:
    """The packed motion ``[body, 6]`` of one push."""
    bodies = range(state.angle.shape[-1])
    return np.array(
        [
            [
                *double(state.position[push, body]),
                float(state.angle[push, body]),
                *double(state.velocity[push, body]),
                float(state.spin[push, body]),
            ]
            for body in bodies
        ]
    )


def to_local(local: LocalPush, motion) -> np.ndarray:
    rows = []
    for body in double(motion):
        place = turned(body[:2] - local.origin, -local.angle)
        rate = turned(body[3:5], -local.angle)
        rows.append([*place, body[2] - local.angle, *rate, body[5]])
    return np.array(rows)


def to_table(local: LocalPush, motion) -> np.ndarray:
    rows = []
    for body in motion:
        place = turned(body[:2], local.angle) + local.origin
        rate = turned(body[3:5], local.angle)
        rows.append([*place, body[2] + local.angle, *rate, body[5]])
    return np.array(rows)


def acting_on(local, motion, i: int) -> list[int]:
    """The other disk if it is the only one, else those within 20 mm."""
    others = [j for j in range(len(motion)) if j != i]
    if len(others) == 1:
        return others
    gaps = {
        j: np.hypot(*(motion[i, :2] - motion[j, :2])) - local.radius[[i, j]].sum()
        for j in others
    }
    return [j for j in others if gaps[j] <= 0.02]


def pair_inputs(
    local, motion, rate_step, i: int, j: int, *, poses: bool = False
) -> np.ndarray:
    """Inputs of f_rel for a pair (eq. 4; with the simulator eq. 9)."""
    numbers = 3 if poses else 2  # of p_i - p_j: with the angle, or without
    return np.concatenate(
        [
            motion[i, 3:6],
            [] if rate_step is None else rate_step[i],
            motion[i, :numbers] - motion[j, :numbers],
            motion[i, 3:6] - motion[j, 3:6],
            [local.mass[i], local.radius[i], local.mass[j], local.radius[j]],
        ]
    )


def body_inputs(local, motion, pose_step, step: int, i: int) -> np.ndarray:
    """Inputs of f_dyn except the effects (eq. 5; with the simulator eq. 10)."""
    action = local.action[step]
    if local.pusher is not None:
        offset = local.pusher[step] - motion[i, :2]
        gap = np.hypot(*offset) - local.radius[i] - local.pusher_radius
        action = np.concatenate([action, offset, [gap]])
    return np.concatenate(
        [
            motion[i, 3:6],
            [] if pose_step is None else pose_step[i],
            action if i == local.pushed else np.zeros_like(action),
            [local.mass[i], local.radius[i]],
        ]
    )


def place_inputs(local, motion, i: int) -> np.ndarray:
    """Where on the table a body is, how it is turned there, and the push."""
    x, y, turn = to_table(local, motion)[i, :3]
    angle = local.angle
    return np.array([x, y, *unit(turn), *unit(angle), *unit(turn - angle)])


def unit(angle) -> list[float]:
    return [np.cos(angle), np.sin(angle)]


def layers(net, x) -> np.ndarray:
    for index, (weight, bias) in enumerate(zip(net.weights, net.biases, strict=True)):
        x = x @ double(weight) + double(bias)
        if index < len(net.weights) - 1:
            x = np.maximum(x, 0)
    return x


def standardised(x, mean, deviation) -> np.ndarray:
    return (x - double(mean)) / double(deviation)


def bounded(x) -> np.ndarray:
    return BOUND * np.tanh(x / BOUND)


def accelerations(network, local, motion, simulated_step, step: int) -> np.ndarray:
    scales, bodies = network.scales, range(len(motion))
    features = network.features
    poses = RelativePose() in features.blocks
    pose_step = None if simulated_step is None else simulated_step[:, :3]
    rate_step = None if simulated_step is None else simulated_step[:, 3:]
    found = []
    for i in bodies:
        effect = np.zeros(16)
        for j in acting_on(local, motion, i):
            seen = pair_inputs(local, motion, rate_step, i, j, poses=poses)
            if not features.has_si_units:
                seen = standardised(seen, scales.pair_mean, scales.pair_deviation)
                seen = bounded(seen) if features.has_bounds else seen
            effect += layers(network.rel, seen)
        seen = body_inputs(local, motion, pose_step, step, i)
        if features.has_place:
            seen = np.concatenate([seen, place_inputs(local, motion, i)])
        if not features.has_si_units:
            seen = standardised(seen, scales.body_mean, scales.body_deviation)
            seen = bounded(seen) if features.has_bounds else seen
        out = layers(network.dyn, np.concatenate([seen, effect]))
        found.append(out * double(scales.acceleration))
    return np.array(found)


def rollout(network, push_batch, simulated, push: int) -> np.ndarray:
    """The predicted motion ``[time, body, 6]`` of one push of a batch.

    `push_batch` is the scenes, the initial states and the controls.
    `simulated` is s-bar after each step, ``[push, time, body, 6]``; None for IN.
    """
    turns = not network.features.has_table_axes
    local = local_push(*push_batch, push, turns=turns)
    motion = before = local.start
    path = []
    for step in range(len(local.action)):
        simulated_step = None
        if simulated is not None:
            after = to_local(local, simulated[push, step])
            simulated_step, before = after - before, after
        change = accelerations(network, local, motion, simulated_step, step)
        rate = motion[:, 3:6]
        if network.integrator == RelaxingResidual():
            engine = simulated_step[:, :3] / network.time_step
            fading = np.exp(-network.time_step / 0.1)
            rate = engine + fading * (rate - engine + simulated_step[:, 3:])
        rate = rate + network.time_step * change
        pose = motion[:, 0:3] + network.time_step * rate
        motion = np.concatenate([pose, rate], axis=1)
        path.append(to_table(local, motion))
    return np.array(path)
