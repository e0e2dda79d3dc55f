"""Models in scripts, given by name, as folder or as object."""

import os

from sainet.models.dynamics import AbstractDynamics
from sainet.models.identity import ModelId
from sainet.models.library import load_model
from sainet.models.model import Model

Loadable = Model | AbstractDynamics | os.PathLike[str] | str


def load(model: Loadable, *, engine: str | None = None) -> Model:
    """Return a model, ready to predict.

    Args:
        model: `physics`, `physics-true`; a network that ships with the package: `in`,
            `sain`, `sain-bullet`, `in-stroke`, `sain-stroke`; or the folder of a
            trained network or of identified parameters. A model is returned as it is;
            dynamics of your own become one.
        engine: inside the model, `planar` or `bullet`; None is planar for physics, and
            for a network the engine that it was trained around.

    Raises:
        UnknownName: neither a model nor a folder has this name, or no engine.
        BadCheckpoint: the folder holds no network that can be used.
        MissingExtra: the engine needs a package that is not installed.
    """
    if isinstance(model, Model):
        return model
    if isinstance(model, AbstractDynamics):
        name = type(model).__name__.lower()
        return Model(ModelId(kind="physics", name=name), model)
    return load_model(os.fspath(model), engine=engine)
