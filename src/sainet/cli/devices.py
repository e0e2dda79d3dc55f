"""Settings of JAX that precede its first array."""

import os

from sainet.runs.errors import BadInput
from sainet.runs.interrupts import interrupts_wait
from sainet.runs.manifest import use_cache
from sainet.runs.workers import core_count

__all__ = ["compile_fast_elsewhere", "use_cache", "use_devices"]

# Compilation takes a sixth of the time, and compiled code three times as long.
_FAST: dict[str, str | bool] = {
    "xla_backend_optimization_level": "0",
    "xla_cpu_use_fusion_emitters": False,
    "xla_cpu_parallel_codegen_split_count": "1",
}


def use_devices(count: int | None = None) -> None:
    """Give JAX one CPU device per core; a GPU takes precedence.

    Raises:
        BadInput: a count below one.
    """
    if count is not None and count < 1:
        raise BadInput(f"--devices is {count}; it must be at least 1.")
    use_cache()
    with interrupts_wait():
        import jax

    jax.config.update("jax_num_cpu_devices", count or core_count())


def compile_fast_elsewhere() -> None:
    """Have processes that start from now on compile fast instead of well.

    XLA ends a process with an option that it does not know, as a later version might.
    This process therefore tries the options before. `XLA_FLAGS` takes precedence.
    """
    import jax

    try:
        jax.jit(lambda x: x + 1).lower(0.0).compile(compiler_options=_FAST)
    except jax.errors.JaxRuntimeError:
        return
    words = (f"--{name}={str(value).lower()}" for name, value in _FAST.items())
    os.environ.setdefault("XLA_FLAGS", " ".join(words))
