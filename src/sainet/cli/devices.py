"""Settings of JAX that precede its first array."""

from sainet.runs.errors import BadInput
from sainet.runs.manifest import use_cache
from sainet.runs.workers import core_count

__all__ = ["use_cache", "use_devices"]


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
