"""Trees of arrays as safetensors files: no pickle, named leaves, checked shapes."""

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from sainet.runs.documents import read_file, write_bytes
from sainet.runs.errors import BadCheckpoint

_LARGEST = 1 << 30  # bytes of a file


def save_arrays(path: Path, tree: Any) -> bytes:  # noqa: ANN401
    """Write all arrays of a tree atomically; returns what was written."""
    from safetensors.numpy import save

    leaves = jax.tree_util.tree_flatten_with_path(tree)[0]
    # Not ascontiguousarray: it makes a scalar an array of one.
    named = {
        jax.tree_util.keystr(where): np.asarray(leaf, order="C")
        for where, leaf in leaves
    }
    data = save(named)
    write_bytes(path, data)
    return data


def load_arrays(path: Path, like: Any) -> Any:  # noqa: ANN401
    """Read a tree of arrays that is shaped like another, of arrays or their shapes.

    Raises:
        BadCheckpoint: the file is missing or damaged, or an array does not fit.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    try:
        found = load(read_file(path, most=_LARGEST, error=BadCheckpoint))
    except (SafetensorError, ValueError, KeyError) as error:
        raise BadCheckpoint(
            f"{path}: truncated or no safetensors file ({str(error).splitlines()[0]}); "
            "train the network again."
        ) from None
    leaves, structure = jax.tree_util.tree_flatten_with_path(like)
    return jax.tree.unflatten(
        structure, [_take(path, found, where, leaf) for where, leaf in leaves]
    )


def _take(path: Path, found: dict[str, np.ndarray], where: Any, like: Any) -> Any:  # noqa: ANN401
    name = jax.tree_util.keystr(where)
    if name not in found:
        raise BadCheckpoint(f"{path}: {name} is missing; train the network again.")
    array = found[name]
    shape, dtype = np.shape(like), jnp.result_type(like)
    if array.shape != shape or array.dtype != dtype:
        raise BadCheckpoint(
            f"{path}: {name} is {array.dtype}{list(array.shape)}, not "
            f"{dtype}{list(shape)}; it belongs to another network."
        )
    if np.issubdtype(array.dtype, np.floating) and not np.isfinite(array).all():
        raise BadCheckpoint(
            f"{path}: {name} holds NaN or infinity; train the network again."
        )
    return jnp.asarray(array)
