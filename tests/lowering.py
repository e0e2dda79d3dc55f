"""Lets the programs that JAX lowers share a context of MLIR while the tests run.

JAX makes a context for each program, and fills it with all dialects: a third of the
time of small tests. If JAX renames its private `make_ir_context`, nothing is shared.
"""

import threading
from collections.abc import Callable

from jax._src.interpreters import mlir

_PROGRAMS = 500  # that share a context: it keeps everything that was ever in it


class _Shared(threading.local):
    """The context of a thread, renewed from time to time."""

    def __init__(self, make: Callable[[], object]) -> None:
        self._make = make
        self._used, self._context = _PROGRAMS, None

    def __call__(self) -> object:
        if self._used >= _PROGRAMS:
            self._used, self._context = 0, self._make()
        self._used += 1
        return self._context


def install() -> None:
    """Share contexts in this process."""
    make = getattr(mlir, "make_ir_context", None)
    if make is not None:
        mlir.make_ir_context = _Shared(make)
