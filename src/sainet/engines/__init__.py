"""Engines that predict how pushed disks move."""

from typing import TYPE_CHECKING

from sainet.runs.names import load_named

if TYPE_CHECKING:
    from sainet.engines.base import AbstractEngine

RECORDED = "recorded"  # in the place of an engine: pushes of a physical robot
ENGINES = {
    "bullet": "sainet.engines.bullet.engine:BulletEngine",
    "planar": "sainet.engines.planar.engine:PlanarEngine",
}


def make_engine(name: str) -> "AbstractEngine":
    """Return a new engine with its default settings.

    Args:
        name: planar or bullet.

    Raises:
        UnknownName: no engine has this name.
        MissingExtra: the engine needs a package that is not installed.
    """
    return load_named("engine", ENGINES, name)()
