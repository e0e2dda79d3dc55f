"""Time of a call, including the computation of its arrays."""

from collections.abc import Callable
from statistics import median
from time import perf_counter
from typing import Any

import jax

from sainet.runs.errors import BadSetting


def seconds(call: Callable[[], Any]) -> float:
    """Return the time of one call until all arrays that it returns are computed (s)."""
    start = perf_counter()
    jax.block_until_ready(call())
    return perf_counter() - start


def median_seconds(
    call: Callable[[], Any], runs: int = 5, *, warm_up: int = 1
) -> float:
    """Return the median time of several calls (s).

    Args:
        call: function to time, including the computation of the arrays it returns.
        runs: number of timed calls.
        warm_up: earlier calls that are not timed, for compilation and thread start.
    """
    check_runs(runs)
    for _ in range(warm_up):
        seconds(call)
    return median(seconds(call) for _ in range(runs))


def check_runs(runs: int) -> None:
    """Raise `BadSetting` if there are no measurements to take the median of."""
    if runs < 1:
        raise BadSetting("runs", runs, "at least 1")
