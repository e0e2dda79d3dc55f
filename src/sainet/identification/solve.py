"""Nonlinear least squares over the free parameters."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from sainet.identification.parameters import bounds_of, from_coordinate, to_coordinate
from sainet.identification.residuals import Sample, Scale, residuals, slopes

Try = Callable[[float], None]  # called with the root mean square of all errors

_INSIDE = 1e-3  # distance of initial coordinates from the bounds


def solve(
    start: Mapping[str, float],
    free: Sequence[str],
    scale: Scale,
    parts: Sequence[Sample],
    *,
    on_try: Try,
) -> dict[str, float]:
    """Return all values, with the free parameters at the least-squares solution."""
    bounds = bounds_of(free)
    before = {name: to_coordinate(name, value) for name, value in start.items()}

    def at(vector: np.ndarray) -> dict[str, float]:
        return before | dict(zip(free, vector.tolist(), strict=True))

    def residual(vector: np.ndarray) -> np.ndarray:
        found = [residuals(at(vector), scale, part).ravel() for part in parts]
        whole = np.concatenate(found)
        on_try(float(np.sqrt(np.mean(whole**2))))
        return whole

    def slope(vector: np.ndarray) -> np.ndarray:
        found = [slopes(at(vector), free, scale, part) for part in parts]
        return np.concatenate([part.reshape(-1, len(free)) for part in found])

    solution = least_squares(
        residual,
        np.clip(
            [before[name] for name in free], bounds[0] + _INSIDE, bounds[1] - _INSIDE
        ),
        slope,  # pyright: ignore[reportArgumentType]
        bounds=bounds,
        loss="soft_l1",
        x_scale="jac",
    )
    return {name: from_coordinate(name, x) for name, x in at(solution.x).items()}
