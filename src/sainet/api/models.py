"""Models in scripts, given by name, as folder or as object."""

import jax

from sainet.models.library import Loadable, as_model
from sainet.models.model import Model
from sainet.runs.manifest import WORTH_KEEPING, cache_folder


def load(model: Loadable, *, engine: str | None = None) -> Model:
    """Return a model, ready to predict.

    What JAX compiles from then on is kept in ``~/.cache/sainet``, unless JAX was given
    another folder (``jax_compilation_cache_dir``): the next script starts faster.

    Args:
        model: `physics`, `physics-true`; a network that ships with the package: `in`,
            `sain`, `sain-bullet`, `in-stroke`, `sain-stroke`, `sain-any`; or the folder
            of a trained network or of identified parameters. A model is returned as it
            is; dynamics of your own become one.
        engine: inside the model, `planar` or `bullet`; None is planar for physics, and
            for a network the engine that it was trained around.

    Raises:
        UnknownName: neither a model nor a folder has this name, or no engine.
        BadCheckpoint: the folder holds no network that can be used.
        MissingExtra: the engine needs a package that is not installed.
    """
    _keep_compiled()
    return as_model(model, engine=engine)


def _keep_compiled() -> None:
    if getattr(jax.config, "jax_compilation_cache_dir") is None:  # noqa: B009
        jax.config.update("jax_compilation_cache_dir", str(cache_folder()))
        least = "jax_persistent_cache_min_compile_time_secs"
        jax.config.update(least, WORTH_KEEPING)
