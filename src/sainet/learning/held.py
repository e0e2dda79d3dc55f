"""Predictions of batches of pushes, as training makes them."""

from functools import partial

from jaxtyping import Array, Float

from sainet.datasets.batch import PushBatch
from sainet.models.correctors import Start
from sainet.models.correctors.held import unroll_held
from sainet.models.correctors.network import AbstractNetwork
from sainet.models.inputs import push_frame
from sainet.models.integrators import RelaxingResidual


def predict_batch(
    network: AbstractNetwork, batch: PushBatch, hold: int = 1
) -> Float[Array, "time push body 6"]:
    """Predict each push recurrently from its start, with the stored s-bar (eq. 1).

    Args:
        network: IN or SAIN.
        batch: of pushes, with s-bar for SAIN.
        hold: length of the zero-order hold of an additive network (steps).
    """
    is_held = isinstance(network.integrator, RelaxingResidual) and hold > 1
    initial, has_simulator = batch.initial, network.features.has_simulator
    frame = push_frame(batch.scene, initial)
    return network.in_frame(
        batch.scene,
        Start(initial, frame, initial if has_simulator else None),
        batch.controls,
        batch.simulated if has_simulator else None,
        unroll=partial(unroll_held, hold=hold) if is_held else None,
    )
