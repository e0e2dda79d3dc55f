"""Settings of experiments, free of JAX."""

from dataclasses import dataclass
from typing import Literal

Scale = Literal["quick", "paper"]


@dataclass(frozen=True, kw_only=True)
class DemoConfig:
    """How small the demo is."""

    pushes: int = 1000
    """Pushes to train on."""
    test_pushes: int = 200
    """Pushes to compare the models on."""
    iterations: int = 300
    """Gradient steps for each network."""
    seed: int = 0
    """Of everything random."""
