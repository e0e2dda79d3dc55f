"""How experiments train on few pushes, at either scale."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from sainet.learning.config import FINE_TUNING, FROM_ENGINE, RESIDUAL_TUNING, FitConfig
from sainet.studies.config import Scale

_QUICK_ITERATIONS = 20


def recipe(
    start_from: str | None, scale: Scale, pushes: int, changes: Mapping[str, Any]
) -> FitConfig:
    """Return the settings that hold for so many pushes.

    Args:
        start_from: a network, the engine, or None for drawn weights, whose settings
            are those of a network.
        scale: quick is a few iterations.
        pushes: of which a batch has no more.
        changes: to the defaults.
    """
    config = replace(
        RESIDUAL_TUNING if start_from == FROM_ENGINE else FINE_TUNING, **changes
    )
    size = min(config.batch_size, pushes)
    if scale == "quick":
        return replace(config, batch_size=size, iterations=_QUICK_ITERATIONS)
    return replace(config, batch_size=size)
