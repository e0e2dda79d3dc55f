"""Benchmarks of what has to be fast: each case returns its figures in one dict.

Figures compare what was measured side by side, for machines are shared and their
speed drifts; `docs/benchmarks.md` says what each of them means.
"""

from collections.abc import Callable
from typing import Any

from sainet.runs.names import load_named

# Functions that take `runs`.
CASES = {
    "engines": "sainet.bench.engines:bench_engines",
    "planning": "sainet.bench.planning:bench_planning",
    "training": "sainet.bench.training:bench_training",
}


def load_case(name: str) -> Callable[..., dict[str, Any]]:
    """Return the function of a case; its argument `runs` is the measurements to take.

    Raises:
        UnknownName: no case has this name.
    """
    return load_named("benchmark", CASES, name)
