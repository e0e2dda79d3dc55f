"""Sets of hashes as text: which pushes a model was trained on."""

import base64
import binascii

import numpy as np
from jaxtyping import UInt64

from sainet.runs.errors import BadInput

BYTES = 6  # of a hash: among 10^5 pushes a chance collision has a probability of 2e-5


def digests_to_text(hashes: UInt64[np.ndarray, " push"], *others: str) -> str:
    """Return a set of hashes as text (Base64): eight characters each, sorted.

    Args:
        hashes: to include.
        others: sets as text, to include as well.

    Raises:
        BadInput: one of these is damaged.
    """
    whole = np.concatenate([hashes, *map(digests_from_text, others)])
    values = np.unique(whole).astype(">u8").view(np.uint8).reshape(-1, 8)
    return base64.b64encode(values[:, 8 - BYTES :].tobytes()).decode()


def digests_from_text(text: str) -> UInt64[np.ndarray, " push"]:
    """Undo `digests_to_text`.

    Raises:
        BadInput: the text is damaged.
    """
    try:
        data = base64.b64decode(text, validate=True)
        rows = np.frombuffer(data, np.uint8).reshape(-1, BYTES)
    except (binascii.Error, ValueError):
        raise BadInput("the set of push hashes is damaged; train again.") from None
    values = np.zeros((len(rows), 8), np.uint8)
    values[:, 8 - BYTES :] = rows
    return values.reshape(-1).view(">u8").astype(np.uint64)


def pushes_overlap(trained: str, hashes: UInt64[np.ndarray, " push"]) -> int:
    """Return how many pushes are among those that a model was trained on.

    Args:
        trained: the model's training pushes, by `digests_to_text`.
        hashes: of the pushes in question, by `Store.push_hashes`.

    Raises:
        BadInput: the text is damaged.
    """
    return int(np.isin(hashes, digests_from_text(trained)).sum())
