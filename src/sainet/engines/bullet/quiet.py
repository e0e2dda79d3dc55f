"""Import of PyBullet without its banner."""

import ctypes
import os
import sys
from functools import lru_cache
from importlib import import_module
from typing import Any


@lru_cache
def load_pybullet() -> Any:  # noqa: ANN401
    """Return the PyBullet module, imported on first use."""
    sys.stdout.flush()
    kept = [(os.dup(file), file) for file in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for _, file in kept:
            os.dup2(nowhere, file)
        module = import_module("pybullet")
        ctypes.CDLL(None).fflush(None)  # the banner is in C's output buffer
    finally:
        for copy, file in kept:
            os.dup2(copy, file)
            os.close(copy)
        os.close(nowhere)
    return module
