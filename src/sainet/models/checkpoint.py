"""Trained networks on disk: arrays, and the checks that weights and card fit."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import msgspec
import numpy as np
from jaxtyping import PRNGKeyArray

from sainet.models.card import WEIGHTS, Card, read_card
from sainet.models.contacts import ContactFeatures
from sainet.models.correctors.contact import HOLD, ContactNetwork
from sainet.models.correctors.feedforward import (
    FeedforwardNetwork,
    WholeState,
    whole_state,
)
from sainet.models.correctors.interaction import InteractionNetwork
from sainet.models.correctors.network import AbstractNetwork, Scales
from sainet.models.features import AbstractFeatures, FeatureSet, feature_set
from sainet.models.integrators import INTEGRATORS, Integrator
from sainet.models.nominal import NominalFeatures
from sainet.runs.documents import (
    AGAIN,
    UNSEALED,
    check_sealed,
    content_hash,
    read_file,
    sealed,
    write_bytes,
)
from sainet.runs.errors import BadCheckpoint

_LARGEST = 1 << 32  # bytes of a file


def save_arrays(path: Path, tree: Any) -> bytes:  # noqa: ANN401
    """Write all arrays of a tree atomically; returns what was written."""
    leaves = jax.tree_util.tree_flatten_with_path(tree)[0]
    named = {jax.tree_util.keystr(where): leaf for where, leaf in leaves}
    return write_arrays(path, named)


def write_arrays(path: Path, arrays: Mapping[str, Any]) -> bytes:
    """Write named arrays atomically, sealed; returns what was written."""
    from safetensors.numpy import save

    # Not ascontiguousarray: it makes a scalar an array of one.
    named = {name: np.asarray(array, order="C") for name, array in arrays.items()}
    data = sealed(save(named, {"seal": UNSEALED}))
    write_bytes(path, data)
    return data


def read_arrays(
    path: Path, remedy: str = AGAIN, *, known: str | None = None
) -> dict[str, np.ndarray]:
    """Read named arrays.

    Args:
        path: of the file.
        remedy: what the user can do, without a full stop.
        known: hash of the file in a card; None: the file has a seal.

    Raises:
        BadInput: the file is missing, damaged or edited.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    if not path.exists():
        raise BadCheckpoint(f"{path}: no such file; {remedy}.")
    data = read_file(path, most=_LARGEST, error=BadCheckpoint)
    try:
        found = load(data)
    except (SafetensorError, ValueError, KeyError) as error:
        raise BadCheckpoint(
            f"{path}: truncated or no safetensors file ({str(error).splitlines()[0]}); "
            f"{remedy}."
        ) from None
    if known is None:
        header = msgspec.json.decode(data[8 : 8 + int.from_bytes(data[:8], "little")])
        check_sealed(path, data, header.get("__metadata__", {}).get("seal", ""))
    elif content_hash(data) != known:
        raise BadCheckpoint(
            f"{path}: its hash is another than `weights` of the card; the two do not "
            f"belong together, {remedy}."
        )
    return found


def load_arrays(
    path: Path,
    like: Any,  # noqa: ANN401
    remedy: str = AGAIN,
    *,
    known: str | None = None,
) -> Any:  # noqa: ANN401
    """Read a tree of arrays that is shaped like another, of arrays or their shapes.

    Args:
        path: of the file.
        like: the other tree.
        remedy: see `read_arrays`.
        known: see `read_arrays`.

    Raises:
        BadCheckpoint: the file is missing or damaged, or an array does not fit.
    """
    found = read_arrays(path, remedy, known=known)
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


def load_network(folder: Path) -> tuple[AbstractNetwork, Card]:
    """Read a trained network and its card.

    Raises:
        BadCheckpoint: missing, damaged, of a newer format, or the two do not fit.
    """
    card = read_card(folder)
    features = features_of(
        card.identity.features,
        card.kind,
        simulator=card.identity.kind == "sain",
        time_step=card.time_step,
        disks=card.disks,
    )
    integrator, hold = INTEGRATORS[card.integrator], card.recipe.hold or 1
    network = untrained(features, card.time_step, integrator, hold)
    again = "train the network again"
    return load_arrays(folder / WEIGHTS, network, again, known=card.weights), card


def features_of(
    name: str, setup: str, *, simulator: bool, time_step: float, disks: int
) -> AbstractFeatures:
    """Return the inputs of a network.

    Args:
        name: of the features.
        setup: whose controls the network takes, `robot` or `direct-force`.
        simulator: whether the network takes the simulator prediction (SAIN).
        time_step: s.
        disks: number of disks of every scene, of a network that takes only so many.
    """
    if name == "whole-state":
        return whole_state(setup, simulator=simulator, disks=disks)
    if name == "contact":
        return ContactFeatures(time_step)
    found = feature_set(setup, simulator=simulator, name=name)
    return NominalFeatures(found.blocks) if name == "nominal" else found


def new_network(
    features: AbstractFeatures,
    time_step: float,
    integrator: Integrator,
    *,
    key: PRNGKeyArray,
    scales: Scales | None = None,
    hold: int = HOLD,
) -> AbstractNetwork:
    """Return an untrained network of the form that fits its features.

    Args:
        features: its inputs.
        time_step: s, of the pushes that it is for.
        integrator: of its accelerations.
        key: draws the weights.
        scales: of its inputs and outputs; None is 1.
        hold: steps over which a contact network is held.
    """
    if isinstance(features, ContactFeatures):
        return ContactNetwork(features, key=key, scales=scales, hold=hold)
    if isinstance(features, WholeState):
        return FeedforwardNetwork(
            features, time_step=time_step, key=key, scales=scales, integrator=integrator
        )
    assert isinstance(features, FeatureSet)
    return InteractionNetwork(
        features, time_step=time_step, key=key, scales=scales, integrator=integrator
    )


def untrained(
    features: AbstractFeatures,
    time_step: float,
    integrator: Integrator,
    hold: int = HOLD,
) -> AbstractNetwork:
    """Return a network of shapes instead of arrays: drawing arrays takes seconds."""

    def make() -> AbstractNetwork:
        key = jax.random.key(0)
        return new_network(features, time_step, integrator, key=key, hold=hold)

    return eqx.filter_eval_shape(make)
