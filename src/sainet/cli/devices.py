"""Settings of JAX that precede its first array."""

import os
import platform
from pathlib import Path

from sainet.runs.documents import content_hash
from sainet.runs.errors import BadInput
from sainet.runs.manifest import processor
from sainet.runs.workers import core_count

_WORTH_KEEPING = "0.5"  # s of compilation


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

    A folder for each processor: code that was compiled for one may not run on another
    that shares the home folder. JAX's own variables take precedence.
    """
    settings = {
        "JAX_COMPILATION_CACHE_DIR": str(cache_folder()),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": _WORTH_KEEPING,
    }
    for name, value in settings.items():
        os.environ.setdefault(name, value)


def cache_folder() -> Path:
    """Return where compiled code is kept: ``$XDG_CACHE_HOME/sainet`` or ~/.cache."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    machine = f"{processor()} {platform.machine()}"
    return Path(home) / "sainet" / content_hash(machine.encode())[:12]
