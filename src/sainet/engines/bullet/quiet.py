"""PyBullet, imported without the line that it prints."""

import ctypes
import os
import sys
from functools import lru_cache
from importlib import import_module
from typing import Any


@lru_cache
def load_pybullet() -> Any:  # noqa: ANN401
    """Return PyBullet's module, imported when it is first wanted."""
    sys.stdout.flush()
    kept = [(os.dup(file), file) for file in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for _, file in kept:
            os.dup2(nowhere, file)
        module = import_module("pybullet")
        ctypes.CDLL(None).fflush(None)  # it prints through C's buffer
    finally:
        for copy, file in kept:
            os.dup2(copy, file)
            os.close(copy)
        os.close(nowhere)
    return module
