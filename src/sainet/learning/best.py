"""The best network so far, by the pushes that are kept for validation."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from sainet.learning.step import Trained, trained_layers, with_layers
from sainet.models.correctors.interaction import InteractionNetwork


class Best(eqx.Module):
    """Its layers, and when and how good it was; part of a checkpoint."""

    layers: Trained
    loss: Float[Array, ""]  # on the validation pushes
    iteration: Int[Array, ""]

    @staticmethod
    def first(network: InteractionNetwork, loss: float) -> "Best":
        """Return the network that training begins with: it may remain the best."""
        return Best(trained_layers(network), jnp.float32(loss), jnp.int32(0))

    def or_better(
        self, network: InteractionNetwork, loss: float, iteration: int
    ) -> "Best":
        """Return the better one of this and another network."""
        if not loss < float(self.loss):
            return self
        return Best(trained_layers(network), jnp.float32(loss), jnp.int32(iteration))

    def is_stale(self, iteration: int, patience: int) -> bool:
        """Return whether nothing has become better for so many iterations."""
        return 0 < patience <= iteration - int(self.iteration)

    def put_into(self, network: InteractionNetwork) -> InteractionNetwork:
        """Return the network with the best layers."""
        return with_layers(network, self.layers)
