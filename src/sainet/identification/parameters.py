"""The parameters of the planar engine that pushes may tell."""

from collections.abc import Mapping
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.engines.identified import FRICTIONS, NAMES, RATIO, USUAL_RATIO
from sainet.engines.planar.engine import PlanarEngine
from sainet.scene import Scene

BOUNDS = {**dict.fromkeys(FRICTIONS, (0.01, 2.0)), RATIO: (0.1, 1.0)}


@dataclass(frozen=True)
class Estimate:
    """What the data say of one parameter."""

    name: str
    value: float  # where the data cannot tell it: that of before
    low: float  # of the 95 % interval
    high: float
    start: float  # before
    doubt: str | None = None  # why the data cannot tell it, if so


def names_for(scene: Scene) -> tuple[str, ...]:
    """Return the parameters that can matter: one disk touches no other."""
    lone = scene.body_count == 1
    return tuple(name for name in NAMES if not (lone and name == "disk_friction"))


def starting_values(scene: Scene, names: tuple[str, ...]) -> dict[str, float]:
    """Return what the scenes say, on average."""
    known = {name: float(jnp.mean(getattr(scene, name))) for name in FRICTIONS}
    return {name: (known | {RATIO: USUAL_RATIO})[name] for name in names}


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
