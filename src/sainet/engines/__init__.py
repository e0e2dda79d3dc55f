"""Engines that predict how pushed disks move, and the noise of the simulated world."""

from typing import TYPE_CHECKING

from sainet.runs.names import load_named

if TYPE_CHECKING:
    from sainet.engines.assumed import AssumedProperties
    from sainet.engines.base import AbstractEngine

ENGINES = {
    "bullet": "sainet.engines.bullet.engine:BulletEngine",
    "planar": "sainet.engines.planar.engine:PlanarEngine",
}

CALIBRATED = "-calibrated"
# What may predict s-bar: an engine with the paper's assumed properties, or with the
# true masses and radii.
ASSUMED_ENGINES = (*ENGINES, *(name + CALIBRATED for name in ENGINES))


def make_engine(name: str) -> "AbstractEngine":
    """Return a new engine with its default settings.

    Raises:
        UnknownName: no engine has this name.
        MissingExtra: the engine needs a package that is not installed.
    """
    return load_named("engine", ENGINES, name)()


def make_assumed_engine(name: str) -> "AssumedProperties":
    """Return an engine with what it believes of a scene: `planar-calibrated`, say.

    Raises:
        UnknownName: no engine has this name.
        MissingExtra: the engine needs a package that is not installed.
    """
    from sainet.engines.assumed import AssumedProperties, beliefs

    engine = make_engine(name.removesuffix(CALIBRATED))
    return AssumedProperties(engine, **beliefs(name))
