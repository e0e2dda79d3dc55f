"""Set JAX up before the first array is made."""

from sainet.errors import BadInput
from sainet.processes import core_count


def use_devices(count: int | None = None) -> None:
    """Make JAX see each core as a device of its own; a GPU takes precedence.

    Raises:
        BadInput: a count below one.
    """
    import jax

    if count is not None and count < 1:
        raise BadInput(f"--devices is {count}; it must be at least 1.")
    jax.config.update("jax_num_cpu_devices", count or core_count())
