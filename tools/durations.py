"""Fit the rates by which `sainet reproduce` tells beforehand how long it takes.

    python tools/durations.py runs/recorded runs/whole-paper [RUN ...]

reads the durations in run folders of `XLA_FLAGS= sainet reproduce --recorded
runs/recorded` at any scale, and writes src/sainet/studies/durations.json. Kinds of work
that these folders do not have keep their rates. The variable is set to nothing so that
the quick scale is compiled like the paper's.
"""

import sys
from collections import defaultdict
from itertools import product
from pathlib import Path
from typing import get_args

import numpy as np
from scipy.optimize import nnls

from sainet.runs.documents import write_document
from sainet.runs.manifest import processor
from sainet.runs.workers import core_count
from sainet.studies import STUDIES, Scale, load_study
from sainet.studies.durations import Clock
from sainet.studies.effort import RATES, Rate, Rates, effort, measured_rates
from sainet.studies.runner import all_steps
from sainet.studies.study import STEPS, Scope, last_steps

TARGET = Path(__file__).parents[1] / "src" / "sainet" / "studies" / RATES


def rate_of(measured: list[tuple[float, float]]) -> Rate:
    """Fit constant and unit, both at least 0, to sizes and seconds, relative."""
    size, seconds = np.array(measured).T
    has_sizes = len(set(size)) > 1  # one size says nothing about others
    design = np.column_stack([np.full_like(size, has_sizes), size]) / seconds[:, None]
    return Rate(*nnls(design, np.ones_like(seconds))[0].tolist())


def main(recorded: str, *runs: str) -> None:
    """Fit and write the rates."""
    pairs: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
    for run, scale in product(runs, get_args(Scale)):
        scope, clock = Scope(scale, Path(recorded)), Clock(Path(run) / STEPS)
        last = last_steps(load_study(name).plan(scope) for name in STUDIES)
        for step in all_steps(last).values():
            if (took := clock.duration(step)) and took.has_ended:
                pairs[effort(step).kind].append((effort(step).size, took.seconds))
    new = {kind: rate_of(each) for kind, each in pairs.items()}
    kinds = dict(sorted((measured_rates().kinds | new).items()))
    write_document(
        TARGET, Rates(processor=processor(), cores=core_count(), kinds=kinds)
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
