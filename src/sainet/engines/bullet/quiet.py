"""PyBullet, imported without the line that it prints."""

import ctypes
import os
import sys
from importlib import import_module
from typing import Any


def _import_quietly(name: str) -> Any:  # noqa: ANN401
    sys.stdout.flush()
    kept = [(os.dup(file), file) for file in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for _, file in kept:
            os.dup2(nowhere, file)
        module = import_module(name)
        ctypes.CDLL(None).fflush(None)  # it prints through C's buffer
    finally:
        for copy, file in kept:
            os.dup2(copy, file)
            os.close(copy)
        os.close(nowhere)
    return module


pybullet = _import_quietly("pybullet")
