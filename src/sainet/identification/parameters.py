"""Identifiable parameters: those of the planar engine, and the camera offset."""

import math
from collections.abc import Mapping, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from msgspec.structs import replace

from sainet.engines.base import AbstractEngine
from sainet.engines.planar.engine import PlanarEngine
from sainet.engines.simulator import (
    UNIFORM_PRESSURE,
    Assumptions,
    InternalEngine,
    PlanarSpec,
    SimulatorSpec,
)
from sainet.scenes.recording import CameraOffset
from sainet.scenes.scene import Scene

Own = AbstractEngine | None
PLANAR = PlanarSpec()
FRICTIONS = ("pusher_friction", "disk_friction", "table_friction")
RATIO = "pressure_radius_ratio"
CAMERA = ("camera_x_mm", "camera_y_mm")  # camera-measured minus robot-measured position
NAMES = (*FRICTIONS, RATIO, *CAMERA)
BOUNDS = {
    **dict.fromkeys(FRICTIONS, (0.01, 2.0)),
    RATIO: (0.1, 1.0),
    **dict.fromkeys(CAMERA, (-5.0, 5.0)),
}
_VAGUE = 3.0  # ratio of interval ends above which a parameter is not identifiable
_VAGUE_MM = 2.0  # the same for offsets: difference of interval ends
_AT_BOUND = 0.01  # relative distance from a bound at which a value counts as at it


def to_coordinate(name: str, value: float) -> float:
    """Return the optimised coordinate: log(value), or a signed offset itself."""
    return value if name in CAMERA else math.log(value)


def to_coordinates(values: Mapping[str, float]) -> dict[str, float]:
    """Return the optimised coordinate of each value."""
    return {name: to_coordinate(name, value) for name, value in values.items()}


def from_coordinate(name: str, coordinate: float) -> float:
    """Return the value at a coordinate."""
    return coordinate if name in CAMERA else math.exp(coordinate)


def values_at(coordinates: Mapping[str, Float[Array, ""]]) -> dict[str, Array]:
    """Return the values at coordinates, as JAX arrays."""
    return {n: x if n in CAMERA else jnp.exp(x) for n, x in coordinates.items()}


def bounds_of(names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest coordinate of each parameter."""
    found = [[to_coordinate(name, end) for end in BOUNDS[name]] for name in names]
    low, high = np.array(found).T
    return low, high


def doubt(name: str, value: float, low: float, high: float) -> str | None:
    """Return why a parameter is not identifiable, or None if it is.

    Args:
        name: the parameter.
        value: its least-squares estimate.
        low: lower end of the 95 % interval.
        high: upper end of the interval.
    """
    least, most = BOUNDS[name]
    if (low, high) == (least, most):
        return "too few pushes depend on it"  # which leaves no interval
    if value - least < _AT_BOUND * abs(least) or most - value < _AT_BOUND * most:
        return f"it is at the edge of the search range, {least:g} to {most:g}"
    if high - low > _VAGUE_MM if name in CAMERA else high > _VAGUE * low:
        return f"anything from {low:.2g} to {high:.2g} fits as well"
    return None


def names_for(scene: Scene, simulator: SimulatorSpec = PLANAR) -> tuple[str, ...]:
    """Return the parameters that affect a scene: one disk has no disk friction.

    The pressure distribution is a parameter of the planar engine only.
    """
    lone = ("disk_friction",) if scene.body_count == 1 else ()
    absent = lone if simulator.engine == PlanarSpec.engine else (*lone, RATIO)
    return tuple(name for name in NAMES if name not in absent)


def starting_values(
    scenes: Sequence[Scene], names: tuple[str, ...]
) -> dict[str, float]:
    """Return the initial values: the means over all scenes."""
    known = {name: _mean([getattr(one, name) for one in scenes]) for name in FRICTIONS}
    known |= {RATIO: UNIFORM_PRESSURE, **dict.fromkeys(CAMERA, 0.0)}
    return {name: known[name] for name in names}


def _mean(parts: Sequence[Float[Array, " _"]]) -> float:
    # The rounding of a single-precision mean depends on the number of values. The mean
    # of equal values must not: it is the first value.
    first, every = np.float64(parts[0]), np.float64(np.concatenate(parts))
    return float(jnp.mean(parts[0])) + float(every.mean() - first.mean())


def with_values(
    scene: Scene, values: Mapping[str, Float[Array, ""]], own: Own = None
) -> tuple[Scene, AbstractEngine]:
    """Return scenes and an engine with these values, differentiable by the values.

    Args:
        scene: of each push.
        values: by the names of the parameters.
        own: an engine of the user's own; None: the planar engine.
    """
    frictions = [name for name in FRICTIONS if name in values]
    changed = eqx.tree_at(
        lambda s: [getattr(s, name) for name in frictions],
        scene,
        [jnp.broadcast_to(values[n], getattr(scene, n).shape) for n in frictions],
    )
    ratio = values.get(RATIO, UNIFORM_PRESSURE)
    return changed, own or PlanarEngine(pressure_radius_ratio=ratio)


def camera_at(values: Mapping[str, Float[Array, ""]]) -> Float[Array, "2"]:
    """Return the camera offset: camera-measured minus robot-measured position (m)."""
    return jnp.stack([values.get(name, jnp.zeros(())) for name in CAMERA]) / 1000


def to_engine(
    values: Mapping[str, float], simulator: SimulatorSpec = PLANAR
) -> InternalEngine:
    """Return the engine with estimated parameters; masses and radii are the scene's."""
    x, y = (values.get(name, 0.0) / 1000 for name in CAMERA)
    assumed = replace(Assumptions(), **{name: values.get(name) for name in FRICTIONS})
    found = replace(simulator, assumptions=assumed)
    if RATIO in values:
        found = replace(found, pressure_radius_ratio=values[RATIO])
    return InternalEngine(found, CameraOffset(x=x, y=y))
