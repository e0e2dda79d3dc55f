"""Engines that predict how pushed disks move, and the noise of the simulated world."""

from importlib import import_module
from typing import TYPE_CHECKING

from sainet.errors import UnknownName

if TYPE_CHECKING:
    from sainet.engines.base import AbstractEngine

# Each name leads to a module and a class in it, so that a missing extra costs
# nothing until it is asked for.
ENGINES = {"planar": ("sainet.engines.planar.engine", "PlanarEngine")}


def make_engine(name: str) -> "AbstractEngine":
    """Return a new engine with its default settings.

    Raises:
        UnknownName: no engine has this name.
    """
    if name not in ENGINES:
        available = ", ".join(sorted(ENGINES))
        raise UnknownName(f"No engine named {name!r}. Available: {available}.")
    module, cls = ENGINES[name]
    return getattr(import_module(module), cls)()
