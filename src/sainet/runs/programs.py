"""Room for compiled programs, in processes that run many steps."""

import gc
import sys
from pathlib import Path

_MAPS = Path("/proc/self/maps")
_MOST_MAPS = 20_000


def make_room() -> None:
    """Forget all compiled programs before the system has no room for more.

    Each occupies several memory maps, of which Linux allows a process 65,530; XLA ends
    with a segmentation fault there. What is needed again is read from the cache.
    """
    jax = sys.modules.get("jax")
    if jax is None or not _MAPS.is_file():
        return
    if _MAPS.read_bytes().count(b"\n") > _MOST_MAPS:
        jax.clear_caches()
        gc.collect()
