"""Benchmarks of the time-critical parts: each case returns its figures in one dict.

Figures compare measurements of the same run, because the speed of shared machines
drifts; `docs/benchmarks.md` defines each figure.
"""

from collections.abc import Mapping

Figures = Mapping[str, float | str | None]  # by name; None where not measured

# Functions that take `runs`.
CASES = {
    "disks": "sainet.bench.disks:bench_disks",
    "engines": "sainet.bench.engines:bench_engines",
    "environments": "sainet.bench.environments:bench_environments",
    "planning": "sainet.bench.planning:bench_planning",
    "screening": "sainet.bench.screening:bench_screening",
    "start": "sainet.bench.start:bench_start",
    "training": "sainet.bench.training:bench_training",
}
