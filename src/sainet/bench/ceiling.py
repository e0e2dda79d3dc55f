"""What the machine can do at most, measured in the same run as what is judged by it."""

import numpy as np

from sainet.bench.timing import median_seconds

SIZE = 1024


def ceiling_gflops(products: int = 5) -> float:
    """Return the rate of NumPy's float32 1024 x 1024 product on all cores (GFLOP/s).

    A product of n x n matrices counts ``2 n^3`` operations. The result has its place
    in memory beforehand: making room for it is none of the product's work.

    Args:
        products: how many are timed, for the median; one more warms up.
    """
    left, right = np.random.default_rng(0).random((2, SIZE, SIZE), dtype=np.float32)
    result = np.empty_like(left)
    time = median_seconds(lambda: np.matmul(left, right, out=result), products)
    return 2 * SIZE**3 / time / 1e9
