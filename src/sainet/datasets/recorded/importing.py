"""Import of resampled pushes as a store with simulator predictions."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from sainet.datasets.batch import simulate
from sainet.datasets.recorded.properties import Properties
from sainet.datasets.recorded.resample import ResampledPush
from sainet.datasets.schema import Arrays, StoreInfo, published_name, simulated_name
from sainet.datasets.store import Store, open_store
from sainet.datasets.writer import write_once
from sainet.engines import RECORDED
from sainet.engines.simulator import simulator_named, stored_simulator
from sainet.runs.documents import checked
from sainet.scenes.recording import Conditions
from sainet.scenes.scene import TIME_STEP

STORED_ENGINES = ("planar", "planar-true")  # whose predictions imports store
_CHUNK_SIZE = 250  # pushes
_CHUNK_STEPS = 300_000  # of all bodies, so that chunks of long pushes stay small

Published = Mapping[str, Float[np.ndarray, "push body 3"]]  # final poses by model


def import_pushes(
    out: Path,
    settings: Mapping[str, object],
    pushes: Sequence[ResampledPush],
    properties: Properties,
    *,
    engines: tuple[str, ...] = STORED_ENGINES,
    published: Published | None = None,
) -> Store:
    """Write a store of recorded pushes, once; an interrupted import resumes.

    Args:
        out: run folder.
        settings: JSON values that identify the source; a changed file is a changed
            setting.
        pushes: at least one, all with the bodies of the properties.
        properties: of all pushes.
        engines: whose predictions are stored.
        published: final poses (m, m, rad) as published, by the name of the model.

    Raises:
        RunConflict: the folder holds something else.
        Diverged: an assumed engine produced NaN or infinity.
        BadInput: the disk is full, or there are too many disks or too long names.
    """
    out, published = Path(out), published or {}
    info = store_info(pushes, engines, tuple(published))
    checked(info, settings.get("source", out))  # before the folder exists
    repeats = _numbered([push.plan for push in pushes])

    def make_chunk(index: int) -> Arrays:
        rows = info.chunk_slice(index)
        part = pushes[rows]
        # Repeat pushes to fill the last chunk: another size would be compiled again.
        whole = [part[i % len(part)] for i in range(min(info.chunk_size, info.pushes))]
        arrays = chunk_arrays(whole, properties, info)
        arrays = {name: array[: len(part)] for name, array in arrays.items()}
        extra = {published_name(name): poses[rows] for name, poses in published.items()}
        return arrays | extra | {"repeat": repeats[rows]}

    known = {**settings, **asdict(properties), "assumed_engines": engines}
    write_once(out, known, info, make_chunk)
    return open_store(out)


def store_info(
    pushes: Sequence[ResampledPush],
    engines: tuple[str, ...],
    published: tuple[str, ...],
) -> StoreInfo:
    """Return the attributes of a store of such pushes."""
    steps = max(push.held_steps for push in pushes)
    limit = _CHUNK_STEPS // (steps * pushes[0].bodies)
    return StoreInfo(
        kind="robot",
        pushes=len(pushes),
        bodies=pushes[0].bodies,
        steps=steps,
        chunk_size=max(1, min(_CHUNK_SIZE, limit)),
        time_step=TIME_STEP,
        engine=RECORDED,
        assumed_engines=tuple(simulator_named(e).stored_as for e in engines),
        groups=tuple(sorted({group_name(push.conditions) for push in pushes} - {""})),
        published=published,
        has_repeats=all(push.plan for push in pushes),
    )


def group_name(conditions: Conditions) -> str:
    """Return the name of a group: surface and speed (mm/s), as far as known."""
    speed = conditions.speed_mm_s
    parts = [conditions.surface, "" if speed is None else f"{speed:.0f}"]
    return "-".join(filter(None, parts))


def chunk_arrays(
    pushes: Sequence[ResampledPush], properties: Properties, info: StoreInfo
) -> Arrays:
    """Return the arrays of some pushes; beyond its end a push holds its command."""
    known = properties.arrays(len(pushes)) | _motion(pushes, info) | _path(pushes, info)
    known = {name: value.astype(np.float32) for name, value in known.items()}
    finite = np.isfinite(known["truth"])
    groups = [group_name(push.conditions) for push in pushes]
    codes = [info.groups.index(name) if name else 0 for name in groups]
    arrays = known | {
        "steps": np.array([push.held_steps for push in pushes], np.int32),
        "group": np.array(codes, np.int32),
        "pose_observed": np.all(finite[..., :3], axis=(-2, -1)),
        "rate_observed": np.all(finite[..., 3:], axis=(-2, -1)),
        "truth_pusher": known["command_position"],
    }
    names = [push.source for push in pushes]
    simulated = {
        simulated_name(engine): simulate(stored_simulator(engine), arrays, info, names)
        for engine in info.assumed_engines
    }
    return arrays | simulated


def _motion(pushes: Sequence[ResampledPush], info: StoreInfo) -> Arrays:
    """Return the truth where it is known, and the state before the push, at rest."""
    initial = np.zeros((len(pushes), info.bodies, 6))
    truth = np.full((len(pushes), info.steps, info.bodies, 6), np.nan)
    for row, push in enumerate(pushes):
        initial[row, :, :3] = push.initial
        truth[row, : push.steps] = push.motion
    return {"initial": initial, "truth": truth}


def _path(pushes: Sequence[ResampledPush], info: StoreInfo) -> Arrays:
    position = np.zeros((len(pushes), info.steps, 2))
    velocity = np.zeros_like(position)
    for row, push in enumerate(pushes):
        position[row, : push.steps] = push.pusher
        position[row, push.steps :] = push.pusher[-1]
        velocity[row, : push.steps] = push.pusher_velocity
    return {
        "initial_pusher": np.stack([push.initial_pusher for push in pushes]),
        "command_position": position,
        "command_velocity": velocity,
    }


def _numbered(plans: Sequence[Hashable]) -> Int[np.ndarray, " push"]:
    """Return a number for each push: equal plans share it; the first plan has 0."""
    known = {plan: number for number, plan in enumerate(dict.fromkeys(plans))}
    return np.array([known[plan] for plan in plans], np.int32)
