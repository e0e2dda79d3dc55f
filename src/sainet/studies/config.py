"""Settings of studies, free of JAX."""

from dataclasses import dataclass
from typing import Literal

Scale = Literal["quick", "paper"]


@dataclass(frozen=True, kw_only=True)
class DemoConfig:
    """Size of the demo."""

    pushes: int = 1000
    """Number of training pushes."""
    test_pushes: int = 200
    """Number of test pushes."""
    iterations: int = 300
    """Number of iterations per network."""
    seed: int = 0
    """Random seed."""
