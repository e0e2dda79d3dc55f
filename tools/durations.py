"""Fit the rates by which `sainet reproduce` tells beforehand how long it takes.

    python tools/durations.py quick runs/reproduce [paper runs/paper ...]

reads the recorded durations of finished steps, each folder with its scale, and writes
src/sainet/studies/durations.json.
"""

import sys
from collections import defaultdict
from pathlib import Path
from typing import cast

import msgspec
import numpy as np
from scipy.optimize import nnls

from sainet.runs.documents import write_bytes
from sainet.runs.errors import SainetError
from sainet.runs.manifest import processor
from sainet.runs.workers import core_count
from sainet.studies import STUDIES, Scale, load_study
from sainet.studies.durations import Clock
from sainet.studies.effort import RATES, Rate, Rates, effort
from sainet.studies.shares import all_steps, last_steps
from sainet.studies.study import STEPS, Plan, Scope

TARGET = Path(__file__).parents[1] / "src" / "sainet" / "studies" / RATES
RECORDED = Path("runs/recorded")


def plans(scale: Scale) -> list[Plan]:
    """Return the plans of all studies that can run here."""
    scope = Scope(scale, RECORDED if RECORDED.is_dir() else None)
    found = []
    for name in STUDIES:
        study = load_study(name)
        try:
            study.check(scope)
        except SainetError as error:
            print(f"{name} is left out: {error}", file=sys.stderr)
        else:
            found.append(study.plan(scope))
    return found


def rate_of(measured: list[tuple[float, float]]) -> Rate:
    """Fit constant and unit, both at least 0, to sizes and seconds, relative."""
    size, seconds = np.array(measured).T
    design = np.column_stack([np.ones_like(size), size]) / seconds[:, None]
    if len(set(size)) == 1:
        design[:, 0] = 0  # one size says nothing about larger ones: proportional
    constant, unit = nnls(design, np.ones_like(seconds))[0]
    return Rate(float(f"{constant:.3g}"), float(f"{unit:.3g}"))


def main(arguments: list[str]) -> None:
    """Fit and write the rates."""
    measured: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
    for scale, out in zip(arguments[::2], arguments[1::2], strict=True):
        clock = Clock(Path(out) / STEPS)
        for step in all_steps(last_steps(plans(cast("Scale", scale)))).values():
            took, work = clock.duration(step), effort(step)
            if took is not None and took.has_ended:
                measured[work.kind].append((work.size, took.seconds))
    kinds = {kind: rate_of(pairs) for kind, pairs in sorted(measured.items())}
    found = Rates(processor=processor(), cores=core_count(), kinds=kinds)
    write_bytes(TARGET, msgspec.json.format(msgspec.json.encode(found), indent=1))


if __name__ == "__main__":
    main(sys.argv[1:])
