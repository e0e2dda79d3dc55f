"""Timing of calls, and the rate of matrix products of the machine."""

import os
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import jax
import numpy as np

from sainet.runs.errors import BadSetting
from sainet.runs.manifest import WORTH_KEEPING

SIZE = 1024


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


def with_cache(folder: Path) -> dict[str, str]:
    """Return the environment of processes that keep compiled code in a folder."""
    return os.environ | {
        "JAX_COMPILATION_CACHE_DIR": str(folder),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": str(WORTH_KEEPING),
    }


def ceiling_gflops(products: int = 5) -> float:
    """Return the rate of NumPy's float32 1024 x 1024 product on all cores (GFLOP/s).

    A product of n x n matrices counts as ``2 n^3`` operations. The memory of the result
    is allocated in advance, because allocation is not part of the product.

    Args:
        products: number of timed products, for the median; one more is the warm-up.
    """
    left, right = np.random.default_rng(0).random((2, SIZE, SIZE), dtype=np.float32)
    result = np.empty_like(left)
    time = median_seconds(lambda: np.matmul(left, right, out=result), products)
    return 2 * SIZE**3 / time / 1e9
