"""The parameters of the planar engine, and of its camera, that pushes may tell."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.engines.identified import CAMERA, FRICTIONS, NAMES, RATIO, USUAL_RATIO
from sainet.engines.planar.engine import PlanarEngine
from sainet.scenes.scene import Scene

BOUNDS = {
    **dict.fromkeys(FRICTIONS, (0.01, 2.0)),
    RATIO: (0.1, 1.0),
    **dict.fromkeys(CAMERA, (-5.0, 5.0)),
}
_VAGUE = 3.0  # ratio of the ends of an interval, from which a value is not told
_VAGUE_MM = 2.0  # their difference, of an offset
_AT_BOUND = 0.01  # share of a bound, so near to which a value is at it


@dataclass(frozen=True)
class Estimate:
    """What the data say of one parameter."""

    name: str
    value: float  # where the data cannot tell it: that of before
    low: float  # of the 95 % interval
    high: float
    start: float  # before
    doubt: str | None = None  # why the data cannot tell it, if so


def to_coordinate(name: str, value: float) -> float:
    """Return where a value lies on the line that it is looked for on.

    That of its logarithm; an offset, which has a sign, is looked for itself.
    """
    return value if name in CAMERA else math.log(value)


def from_coordinate(name: str, coordinate: float) -> float:
    """Return the value at a coordinate."""
    return coordinate if name in CAMERA else math.exp(coordinate)


def values_at(coordinates: Mapping[str, Float[Array, ""]]) -> dict[str, Array]:
    """Return values at coordinates, all in JAX."""
    return {n: x if n in CAMERA else jnp.exp(x) for n, x in coordinates.items()}


def bounds_of(names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest coordinate of each parameter."""
    found = [[to_coordinate(name, end) for end in BOUNDS[name]] for name in names]
    low, high = np.array(found).T
    return low, high


def doubt(name: str, value: float, low: float, high: float) -> str | None:
    """Say why the data cannot tell a parameter, if they cannot.

    Args:
        name: of the parameter.
        value: where the errors are least.
        low: end of the 95 % interval.
        high: its other end.
    """
    least, most = BOUNDS[name]
    if (low, high) == (least, most):
        return f"too few pushes depend on it: any of {least:g} to {most:g} may do"
    if value - least < _AT_BOUND * abs(least) or most - value < _AT_BOUND * most:
        return f"it is at the end of what is looked at, {least:g} to {most:g}"
    if high - low > _VAGUE_MM if name in CAMERA else high > _VAGUE * low:
        return f"anything from {low:.2g} to {high:.2g} does as well"
    return None


def names_for(scene: Scene) -> tuple[str, ...]:
    """Return the parameters that can matter: one disk touches no other."""
    lone = scene.body_count == 1
    return tuple(name for name in NAMES if not (lone and name == "disk_friction"))


def starting_values(
    scenes: Sequence[Scene], names: tuple[str, ...]
) -> dict[str, float]:
    """Return what all scenes say, on average."""
    known = {name: _mean([getattr(one, name) for one in scenes]) for name in FRICTIONS}
    known |= {RATIO: USUAL_RATIO, **dict.fromkeys(CAMERA, 0.0)}
    return {name: known[name] for name in names}


def _mean(parts: Sequence[Float[Array, " push"]]) -> float:
    # The rounding of a mean in single precision depends on how many there are. What
    # pushes that are all alike were identified from must not: theirs is the first's.
    first, every = np.float64(parts[0]), np.float64(np.concatenate(parts))
    return float(jnp.mean(parts[0])) + float(every.mean() - first.mean())


def with_values(
    scene: Scene, values: Mapping[str, Float[Array, ""]]
) -> tuple[Scene, PlanarEngine]:
    """Return scenes and an engine with these values; differentiable in them."""
    frictions = [name for name in FRICTIONS if name in values]
    changed = eqx.tree_at(
        lambda s: [getattr(s, name) for name in frictions],
        scene,
        [jnp.broadcast_to(values[n], getattr(scene, n).shape) for n in frictions],
    )
    return changed, PlanarEngine(pressure_radius_ratio=values.get(RATIO, USUAL_RATIO))


def camera_at(values: Mapping[str, Float[Array, ""]]) -> Float[Array, "2"]:
    """Return where the camera sees things, minus where the robot has them (m)."""
    return jnp.stack([values.get(name, jnp.zeros(())) for name in CAMERA]) / 1000
