"""How long a call takes, its arrays included."""

from collections.abc import Callable
from statistics import median
from time import perf_counter
from typing import Any

import jax

from sainet.runs.errors import BadSetting


def seconds(call: Callable[[], Any]) -> float:
    """Return how long one call takes until all arrays that it returns are there (s)."""
    start = perf_counter()
    jax.block_until_ready(call())
    return perf_counter() - start


def median_seconds(
    call: Callable[[], Any], runs: int = 5, *, warm_up: int = 1
) -> float:
    """Return the median of several calls (s).

    Args:
        call: what is timed; the arrays that it returns are waited for.
        runs: how many calls are timed.
        warm_up: calls before those, which compile and wake threads; not timed.
    """
    check_runs(runs)
    for _ in range(warm_up):
        seconds(call)
    return median(seconds(call) for _ in range(runs))


def check_runs(runs: int) -> None:
    """Raise `BadSetting` unless there is something to take the median of."""
    if runs < 1:
        raise BadSetting("runs", runs, "at least 1")
