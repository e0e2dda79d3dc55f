"""A push made up by hand: two disks that touch, models a little off; and an episode."""

import msgspec
import numpy as np

from sainet.control.record import EpisodeRecord
from sainet.engines.simulator import SIMULATORS
from sainet.evaluation.measurements import Condition, PublishedValues
from sainet.evaluation.summary import Comparison, Estimate, Factor, Row, Summary
from sainet.models.identity import ModelId
from sainet.report.episode_frames import EndRegion, Replay, Track

STEPS = 200
TIME_STEP = 1 / 240  # s
RADIUS = (0.0525, 0.058)  # m
PUSHER_RADIUS = 0.0048  # m
# By how much each model ends off (mm and degrees), and along which way (rad).
_OFF = {
    "physics": (3.8, 0.9, 0.6),
    "physics-true": (0.95, 0.5, -0.8),
    "in": (0.8, 0.7, 2.0),
    "sain": (0.35, 0.25, 2.6),
}
REGION = EndRegion(
    heading=0.4,
    axes=np.array([[0.0012, 0.0005], [0.0009, 0.0004]]),
    turn=np.radians([0.7, 0.5]),
)


def ramp():
    """Return the share of the motion done at each step, from 0 to 1."""
    time = np.arange(STEPS + 1) * TIME_STEP
    lag = 0.06 * np.exp(-(((time - 0.21) / 0.03) ** 2))
    return np.maximum(np.clip(time / 0.2, 0, 1) - lag, 0)


def true_track():
    share = ramp()
    heading = np.radians(24) + 0.10 * share
    step = 0.0104 * share
    way = np.stack([np.cos(heading), np.sin(heading)], -1)
    first = step[:, None] * way
    along = np.radians(-12)
    apart = sum(RADIUS) * np.array([np.cos(along), np.sin(along)])
    second = apart + 0.55 * step[:, None] * np.array([np.cos(along), np.sin(along)])
    back = np.radians(196)
    pusher = (RADIUS[0] + PUSHER_RADIUS) * np.array([np.cos(back), np.sin(back)])
    return Track(
        position=np.stack([first, second], 1),
        angle=np.stack([0.4 + 0.035 * share, 1.9 - 0.012 * share], 1),
        pusher=pusher + first,
    )


def replay(title="Push 17 of the test set", models=tuple(_OFF)):
    truth = true_track()
    tracks = {"truth": truth}
    for name in models:
        size, turn, way = _OFF.get(name, (1.5, 0.4, 1.0))
        share = ramp()[:, None] ** 1.6
        bend = way + 0.5 * share
        off = 1e-3 * size * share * np.concatenate([np.cos(bend), np.sin(bend)], 1)
        both = np.stack([off, 0.7 * off[:, ::-1]], 1)
        angle = truth.angle + np.radians(turn) * share * np.array([1.0, -0.6])
        region = REGION if name == "sain" else None
        tracks[name] = Track(truth.position + both, angle, truth.pusher, region)
    return Replay(title, TIME_STEP, RADIUS, PUSHER_RADIUS, tracks)


def curves(models=tuple(_OFF)):
    """Return mean errors over time (mm), by model."""
    push = replay(models=models)
    return {name: push.errors_mm(name)[1:] for name in models}


def histories():
    rng = np.random.default_rng(0)
    iteration = np.arange(0, 3000, 20)
    found = {}
    for name, floor in (("in", 0.09), ("sain", 0.06)):
        loss = floor + 2.0 * np.exp(-iteration / 250) + 0.3 * np.exp(-iteration / 1200)
        noisy = loss * rng.lognormal(0, 0.15, len(loss))
        found[name] = (iteration, noisy, iteration[::10], 1.07 * loss[::10])
    return found


def row(model, body, scale, group="", **changes):
    values = {
        "trans_percent": 1.44 * scale,
        "pos_mm": 3.6 * scale,
        "rot_deg": 0.88 * scale**0.5,
        "final_pos_mm": 4.4 * scale,
        "final_rot_deg": 1.1 * scale**0.5,
        "relative_percent": 34.0 * scale,
    }
    estimates = {k: Estimate(v, 0.94 * v, 1.07 * v) for k, v in values.items()}
    estimates |= changes
    known = {k: v for k, v in estimates.items() if v is not None}
    return Row(condition=group, model=model, body=body, values=known, count=500)


def compared(model, against, difference=-0.162, metric="pos_mm"):
    found = Estimate(difference, difference - 0.05, difference + 0.05)
    names = {"condition": "", "model": model, "against": against}
    return Comparison(**names, body=1, metric=metric, difference=found)


IDENTITIES = {
    each.slug: each
    for each in (
        ModelId(kind="physics", simulator=SIMULATORS["planar"]),
        ModelId(kind="physics", simulator=SIMULATORS["planar-true"]),
        ModelId(kind="in"),
        *(
            ModelId(kind="sain", simulator=SIMULATORS[name])
            for name in ("planar", "planar-true", "bullet")
        ),
    )
}


def identity(name):
    """Return the identity of a usual model; of another, one with this name."""
    return IDENTITIES.get(name) or ModelId(kind="published", name=name)


def factor(model, error, baseline=3.6):
    ratio = baseline / error
    estimate = Estimate(ratio, 0.9 * ratio, 1.1 * ratio)
    more = error - baseline
    return Factor(
        condition="",
        model=model,
        metric="pos_mm",
        error=error,
        baseline=baseline,
        factor=estimate,
        difference=Estimate(more, more - 0.1, more + 0.1),
    )


def summary(rows, **parts):
    """Return a summary of such rows, in the order of their first occurrence."""
    models = dict.fromkeys(row.model for row in rows)
    conditions = dict.fromkeys(row.condition for row in rows)
    return Summary(
        models=tuple(map(identity, models)),
        conditions=tuple(Condition(label=label) for label in conditions),
        rows=tuple(rows),
        **parts,
    )


def result():
    """Return a summary of four models, with published values and a comparison."""
    scales = {"physics": 1.0, "physics-true": 0.23, "in": 0.21, "sain": 0.165}
    rows = [
        row(model, body, scale * (1.0, 0.9)[body - 1])
        for model, scale in scales.items()
        for body in (1, 2)
    ]
    paper = {"physics": (6.27, 5.81), "in": (5.76, 3.84), "sain": (4.66, 3.47)}
    published = tuple(
        PublishedValues(condition="", model=identity(model), values={"pos_mm": pair})
        for model, pair in paper.items()
    )
    return summary(
        rows,
        published=published,
        comparisons=(compared("sain", "in"),),
        factors=tuple(factor(model, 3.6 * scale) for model, scale in scales.items()),
    )


def record(pushes=3, **changes):
    """Return the record of an episode, as `record_json` has it."""
    return msgspec.convert(record_json(pushes, **changes), EpisodeRecord)


def record_json(pushes=3, **changes):
    """Return an episode as JSON: straight ahead, 10 mm a push, three samples."""
    turns = [
        {
            "observed": [[10.0 * push, 0.0, 0.0], [10.0 * push + 113, 0.0, 0.0]],
            "actual": [
                [[10.0 * push + x, 1.0, 2.0], [10.0 * push + 113 + x, 1.0, 2.0]]
                for x in (3.0, 6.0, 9.0)
            ],
            "planned": [
                [[10.0 * push + x, 1.0, 2.0], [10.0 * push + 113 + x, 1.0, 2.0]]
                for x in range(10)
            ],
            "pusher": [[10.0 * push + x - 59, 0.0] for x in (3.0, 6.0, 9.0)],
            "distance_mm": 150.0 - 10 * push,
        }
        for push in range(pushes)
    ]
    known = {
        "trial": 0,
        "model": "sain",
        "goals": "easy",
        "turns": turns,
        "pushes": pushes,
        "moved": 1,
        "solved": True,
        "reason": "solved",
        "final_mm": 2.34 if changes.get("solved", True) else 12.34,
        "goal_mm": [150.0, 0.0],
        "tolerance_mm": 5.9,
        "radius_mm": [54.0, 59.0],
        "pusher_radius_mm": 4.8,
        "table_friction": 0.15,
        "decision_s": [0.1] * pushes,
    }
    known |= changes
    (x, y), away = known["goal_mm"], known["final_mm"]
    end = [None] * 3 if away is None else [x - away, y, 2.0]
    return {"final": [[29.0, 1.0, 2.0], end], **known}


def lost_record():
    """Return the record of an episode whose last push left the finite numbers."""
    lost = record_json(solved=False, reason="the simulated world left", final_mm=None)
    lost["turns"][-1]["actual"][1:] = [[[None] * 3] * 2] * 2
    lost["turns"][-1]["pusher"][1:] = [[None] * 2] * 2
    lost["final"] = [[None] * 3] * 2
    return msgspec.convert(lost, EpisodeRecord)


def refused_record():
    """Return the record of an episode whose second push the robot refused."""
    refused = record_json()
    refused["turns"][1] |= {"actual": [], "pusher": [], "planned": []}
    return msgspec.convert(refused, EpisodeRecord)
