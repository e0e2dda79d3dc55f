"""Benchmarks of what has to be fast: each case returns its figures in one dict.

Figures compare what was measured side by side, for machines are shared and their
speed drifts; `docs/benchmarks.md` says what each of them means.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any

from sainet.errors import UnknownName

# Each name leads to a module and a function in it that takes `runs`, loaded when asked
# for: listing the cases must not load JAX.
CASES = {
    "engines": "sainet.bench.engines:bench_engines",
    "training": "sainet.bench.training:bench_training",
}


def load_case(name: str) -> Callable[..., dict[str, Any]]:
    """Return the function of a case; its argument `runs` is the measurements to take.

    Raises:
        UnknownName: no case has this name.
    """
    if name not in CASES:
        available = ", ".join(sorted(CASES))
        raise UnknownName(f"No benchmark named {name!r}. Available: {available}.")
    module, _, function = CASES[name].partition(":")
    return getattr(import_module(module), function)
