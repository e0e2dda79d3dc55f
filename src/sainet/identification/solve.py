"""Nonlinear least squares over the parameters that are free."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from sainet.identification.parameters import BOUNDS
from sainet.identification.residuals import Sample, Scale, residuals, slopes

_INSIDE = 1e-3  # of a bound, where a search begins (log of the value)


def solve(
    start: Mapping[str, float],
    free: Sequence[str],
    scale: Scale,
    parts: Sequence[Sample],
) -> dict[str, float]:
    """Return the best values of the free parameters, the others as they were."""
    bounds = np.log([BOUNDS[name] for name in free]).T
    first = np.log([start[name] for name in free])

    def logs(vector: np.ndarray) -> dict[str, float]:
        given = dict(zip(free, vector.tolist(), strict=True))
        return {name: given.get(name, float(np.log(v))) for name, v in start.items()}

    def residual(vector: np.ndarray) -> np.ndarray:
        found = [residuals(logs(vector), scale, part).ravel() for part in parts]
        return np.concatenate(found)

    def slope(vector: np.ndarray) -> np.ndarray:
        found = [slopes(logs(vector), free, scale, part) for part in parts]
        return np.concatenate([part.reshape(-1, len(free)) for part in found])

    solution = least_squares(
        residual,
        np.clip(first, bounds[0] + _INSIDE, bounds[1] - _INSIDE),
        slope,  # pyright: ignore[reportArgumentType]
        bounds=bounds,
        loss="soft_l1",
        x_scale="jac",
    )
    return {name: float(np.exp(value)) for name, value in logs(solution.x).items()}
