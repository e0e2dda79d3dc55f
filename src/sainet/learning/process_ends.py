"""What Gaussian processes learn from stored pushes: inputs, and residuals of ends."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from sainet.datasets.batch import Prediction, PushBatch, to_batch
from sainet.datasets.store import Store
from sainet.engines.simulator import InternalEngine
from sainet.models.correctors.process import RESIDUALS, known_inputs, travel_of
from sainet.models.identity import ProcessFeatures
from sainet.models.inputs import push_frame
from sainet.models.process_card import up_to
from sainet.runs.errors import BadStore
from sainet.scenes.recording import AGREES, CameraOffset

# Inputs of each kind of features; every kind has those before it.
ADDED: Mapping[ProcessFeatures, tuple[str, ...]] = {
    "angle": ("contact_angle", "bearing", "distance", "mass_", "radius_"),
    "side": ("normal_on_disk",),
    "place": ("place", "normal_on_table", "disk_on_table"),
}
_WORDS = {"angle": "contact angle", "side": "side of the disk", "place": "place"}
_CONSTANT = 1e-5  # standard deviation of an input, relative to its mean
_SHORTEST = 1e-3  # m, the shortest travel of the pusher that tells anything


@dataclass(frozen=True)
class Ends:
    """Inputs and residuals of pushes, per metre of the pusher's travel."""

    names: tuple[str, ...]  # of the inputs
    inputs: Float[np.ndarray, "push input"]
    rates: Float[np.ndarray, "push output"]
    travel: Float[np.ndarray, " push"]  # m
    kinds: Int[np.ndarray, " push"]  # equal for pushes that stay together

    def take(self, rows: Bool[np.ndarray, " push"]) -> "Ends":
        """Return some of the pushes."""
        inputs, rates, travel = self.inputs[rows], self.rates[rows], self.travel[rows]
        return replace(
            self, inputs=inputs, rates=rates, travel=travel, kinds=self.kinds[rows]
        )

    def with_features(self, features: ProcessFeatures) -> "Ends":
        """Return the ends with the inputs of these features only."""
        known = tuple(prefix for each in up_to(features) for prefix in ADDED[each])
        columns = [i for i, key in enumerate(self.names) if key.startswith(known)]
        names = tuple(self.names[i] for i in columns)
        return replace(self, names=names, inputs=self.inputs[:, columns])


def inputs_of(
    store: Store, names: tuple[str, ...], disks: int, camera: CameraOffset = AGREES
) -> Float[np.ndarray, "push input"]:
    """Return some inputs of all pushes, whether their ends were observed or not.

    Raises:
        BadStore: the pushes are of another number of disks, or driven by forces.
    """
    if store.info.bodies != disks or store.info.kind != "robot":
        raise BadStore(
            f"{store.path}: {store.info.kind} pushes of {store.info.bodies} disk(s), "
            f"the process is of robot pushes of {disks}; give such pushes."
        )
    batch = to_batch(store.read(slice(None)), store.info)
    found = _inputs(batch.seen_by(camera))
    return np.stack([np.asarray(found[name], np.float64) for name in names], axis=1)


def known_ends(store: Store, features: ProcessFeatures) -> Ends:
    """Return what `ends_of` does for an engine that errs nowhere."""
    batch = to_batch(store.read(slice(None)), store.info)
    return _known(store, replace(batch, simulated=batch.truth), features)


def ends_of(store: Store, internal: InternalEngine, features: ProcessFeatures) -> Ends:
    """Return inputs and residuals of all pushes whose ends were observed.

    Raises:
        BadStore: too few ends were observed, or an input that was asked for is the
            same in all pushes.
    """
    prediction = Prediction(internal, store.info)
    arrays = prediction.complete(store.read(slice(None), prediction.names))
    return _known(store, prediction.batch(arrays), features)


def _known(store: Store, batch: PushBatch, features: ProcessFeatures) -> Ends:
    inputs, rates, travel = (jax.tree.map(np.asarray, each) for each in _ends(batch))
    known = np.isfinite(rates).all(axis=1) & (travel > _SHORTEST)
    if known.sum() < RESIDUALS:
        raise BadStore(
            f"{store.path}: {known.sum()} pushes of at least 1 mm whose ends were "
            "observed; record more."
        )
    inputs = {name: value[known] for name, value in inputs.items()}
    names = _varying(store, inputs, features)
    values = np.stack([inputs[name] for name in names], axis=1).astype(np.float64)
    rates = rates[known].astype(np.float64)
    kinds = store.repeats()[known]
    return Ends(names, values, rates, travel[known].astype(np.float64), kinds)


@jax.jit
def _ends(batch: PushBatch) -> tuple[dict[str, Array], Array, Array]:
    """Return all inputs, and residuals per metre of travel; NaN where unobserved."""
    seen, count = batch.pose_observed, batch.truth.shape[1]
    last = count - 1 - jnp.argmax(seen[:, ::-1], axis=1)
    rows = jnp.arange(len(last))
    assert batch.simulated is not None
    missed = (batch.truth - batch.simulated)[rows, last, :, :3]
    missed = jnp.where(seen.any(axis=1)[:, None, None], missed, jnp.nan)
    travel, heading = travel_of(batch.controls, batch.initial)
    driven = jnp.cumsum(travel, axis=1)[rows, last]
    cosine, sine = jnp.cos(heading)[:, None], jnp.sin(heading)[:, None]
    x, y, turned = missed[..., 0], missed[..., 1], missed[..., 2]
    turned = jnp.mod(turned + jnp.pi, 2 * jnp.pi) - jnp.pi
    along, across = cosine * x + sine * y, cosine * y - sine * x
    residual = jnp.stack([along, across, turned], axis=-1).reshape(len(last), -1)
    return _inputs(batch), residual / driven[:, None], driven


def _inputs(batch: PushBatch) -> dict[str, Array]:
    """Return everything that can be an input."""
    heading = travel_of(batch.controls, batch.initial)[1]
    pushed = push_frame(batch.scene, batch.initial).pushed
    return known_inputs(batch.scene, batch.initial, pushed, heading)


def _varying(
    store: Store, inputs: Mapping[str, np.ndarray], features: ProcessFeatures
) -> tuple[str, ...]:
    """Return the names of the wanted inputs that vary in a store.

    Raises:
        BadStore: none of those that were asked for does.
    """
    found: list[str] = []
    for each in up_to(features):
        varying = [
            key
            for key, values in inputs.items()
            if key.startswith(ADDED[each]) and _varies(values)
        ]
        if not varying:
            less = ", or fit a Gaussian process without it" * (each != "angle")
            raise BadStore(
                f"{store.path}: the {_WORDS[each]} is the same in all pushes; record "
                f"pushes that differ in it{less}."
            )
        found += varying
    return tuple(found)


def _varies(value: np.ndarray) -> bool:
    return float(np.std(value)) > _CONSTANT * (1e-2 + abs(float(np.mean(value))))
