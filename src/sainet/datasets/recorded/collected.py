"""Datasets of recordings that a robot made."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sainet.datasets.recorded.checks import recording_problems
from sainet.datasets.recorded.importing import import_pushes
from sainet.datasets.recorded.properties import Properties
from sainet.datasets.recorded.resample import resample
from sainet.datasets.store import Store
from sainet.runs.errors import BadInput
from sainet.scenes.recording import Recording


@dataclass(frozen=True)
class Collected:
    """A dataset of the pushes that were executed as commanded."""

    store: Store
    troubles: Mapping[str, int]  # number of pushes that were left out, by reason


def import_recordings(
    out: Path,
    settings: Mapping[str, object],
    recordings: Sequence[Recording],
    properties: Properties,
) -> Collected:
    """Make a dataset of recordings, without those in trouble.

    Args:
        out: run folder.
        settings: JSON values that identify the recordings.
        recordings: of disks with these properties.
        properties: masses and radii as measured, frictions as assumed.

    Raises:
        BadInput: no recording can be used.
        RunConflict: the folder holds something else.
    """
    usable: list[Recording] = []
    troubles: Counter[str] = Counter()
    for each in recordings:
        recording = each if each.trouble else _unwrapped(each)
        if reason := _reason(recording, properties):
            troubles[reason] += 1
        else:
            usable.append(recording)
    if not usable:
        ((worst, _),) = troubles.most_common(1) or [("none was recorded", 0)]
        raise BadInput(
            f"{out}: no push can be used (most often: {worst}); repair that, and "
            "record others."
        )
    pushes = [resample(each) for each in usable]
    return Collected(import_pushes(out, settings, pushes, properties), troubles)


def _unwrapped(recording: Recording) -> Recording:
    """Return a recording whose angles have no jumps of full turns."""
    pose = np.array(recording.pose, np.float64)
    for angle in pose[..., 2].T:
        known = np.isfinite(angle)
        angle[known] = np.unwrap(angle[known])
    return replace(recording, pose=pose)


def _reason(recording: Recording, properties: Properties) -> str:
    """Return why a recording cannot be used; empty if it can."""
    if recording.trouble:
        return recording.trouble
    problem = next(recording_problems(recording, properties), None)
    return problem.kind if problem else ""
