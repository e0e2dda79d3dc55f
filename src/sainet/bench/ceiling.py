"""The matrix-product ceiling of the machine, measured in the run that uses it."""

import numpy as np

from sainet.bench.timing import median_seconds

SIZE = 1024


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
