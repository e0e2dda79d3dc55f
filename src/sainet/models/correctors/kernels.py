"""Kernels of Gaussian processes: how covariance falls with the distance of points.

Rasmussen and Williams (2006), eq. 4.9 and 4.17, for arrays of NumPy and of JAX.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple, Protocol, TypeVar

import jax
import numpy as np

KernelName = Literal["matern-3/2", "matern-5/2", "squared-exponential"]
T = TypeVar("T", np.ndarray, jax.Array)


class _Form(Protocol):
    def __call__(self, far: T, exp: Callable[[T], T], /) -> tuple[T, T]: ...


class Kernel(NamedTuple):
    """A kernel whose amplitude and length scales are 1."""

    factor: float  # `far` is the root of the squared distance times this factor
    # Returns the value, and -2 times its slope in the squared distance.
    of: _Form


def _matern_32(far: T, exp: Callable[[T], T], /) -> tuple[T, T]:
    faded = exp(-far)
    return (1 + far) * faded, 3 * faded


def _matern_52(far: T, exp: Callable[[T], T], /) -> tuple[T, T]:
    faded, near = exp(-far), 1 + far
    return (near + far**2 / 3) * faded, 5 / 3 * near * faded


def _squared_exponential(far: T, exp: Callable[[T], T], /) -> tuple[T, T]:
    faded = exp(-(far**2) / 2)
    return faded, faded


KERNELS: Mapping[KernelName, Kernel] = MappingProxyType(
    {
        "matern-3/2": Kernel(3.0, _matern_32),
        "matern-5/2": Kernel(5.0, _matern_52),
        "squared-exponential": Kernel(1.0, _squared_exponential),
    }
)
