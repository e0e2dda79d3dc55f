"""Content hashes of stored pushes: the same push has the same hash in every store."""

import hashlib

import numpy as np
from jaxtyping import UInt64

from sainet.datasets.schema import Arrays, StoreInfo
from sainet.runs.digests import BYTES

_STARTS = ("initial", "initial_pusher")
_COMMANDS = {
    "robot": ("command_position",),
    "direct-force": ("force", "contact_offset"),
}


def hashed_names(info: StoreInfo) -> tuple[str, ...]:
    """Return the arrays that a push hash depends on."""
    return ("steps", *_STARTS, *_COMMANDS[info.kind])


def hash_pushes(arrays: Arrays, info: StoreInfo) -> UInt64[np.ndarray, " push"]:
    """Return a hash of where each push started and of its command.

    The hash does not depend on what another import may assume (masses, frictions), on
    simulator predictions, nor on the other pushes of the store.

    Args:
        arrays: of some pushes, by variable name; `hashed_names` lists the needed ones.
        info: of their store.
    """
    steps = arrays["steps"]
    hashes = np.empty(len(steps), np.uint64)
    for row, count in enumerate(steps):
        digest = hashlib.sha256(int(count).to_bytes(8, "little"))
        for name in hashed_names(info)[1:]:
            value = arrays[name][row]
            # Beyond its end a push is filled up to the longest one of the store.
            value = value[:count] if name in ("command_position", "force") else value
            digest.update(np.ascontiguousarray(value, "<f4").tobytes())
        hashes[row] = int.from_bytes(digest.digest()[:BYTES], "big")
    return hashes
