"""PyBullet, imported without the line that it prints: stdout may be for JSON alone."""

import ctypes
import os
import sys
from importlib import import_module
from typing import Any


def _import_quietly(name: str) -> Any:  # noqa: ANN401
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        module = import_module(name)
        ctypes.CDLL(None).fflush(None)  # it prints through C's buffer
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
    return module


pybullet = _import_quietly("pybullet")
