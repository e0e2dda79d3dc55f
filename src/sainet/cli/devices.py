"""Settings of JAX that precede its first array."""

import os

from sainet.runs.errors import BadInput
from sainet.runs.manifest import WORTH_KEEPING, cache_folder
from sainet.runs.workers import core_count


def use_devices(count: int | None = None) -> None:
    """Give JAX one CPU device per core; a GPU takes precedence.

    Raises:
        BadInput: a count below one.
    """
    if count is not None and count < 1:
        raise BadInput(f"--devices is {count}; it must be at least 1.")
    use_cache()
    import jax

    jax.config.update("jax_num_cpu_devices", count or core_count())


def use_cache() -> None:
    """Keep what JAX compiles, for this process and those it starts.

    JAX's own variables take precedence.
    """
    settings = {
        "JAX_COMPILATION_CACHE_DIR": str(cache_folder()),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": str(WORTH_KEEPING),
    }
    for name, value in settings.items():
        os.environ.setdefault(name, value)
