"""The training problem of the benchmark: SAIN on simulated pushes, as in `fit`."""

from typing import NamedTuple

import jax

from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import simulate_chunk, store_info
from sainet.learning.loss import LossWeights, feature_scales, loss_weights
from sainet.learning.recipes import PAPER, Recipe
from sainet.learning.step import FitState, even_batch, first_state
from sainet.models.correctors.interaction import InteractionNetwork
from sainet.models.features import feature_set


class Problem(NamedTuple):
    """Inputs of a gradient step."""

    recipe: Recipe
    state: FitState
    weights: LossWeights
    batch: PushBatch


def make_problem(pushes: int = 100, steps: int = 200) -> Problem:
    """Return a simulated batch with an untrained SAIN.

    Args:
        pushes: pushes in the batch: robot setup, two disks, the paper's distributions.
        steps: steps of each push, at most 200.
    """
    data = GenerateConfig(pushes=pushes, chunk_size=pushes)
    info = store_info(data)
    arrays = simulate_chunk(data, 0)
    batch = to_batch(arrays, info, steps=steps, simulated=data.assumed_engine[0])
    recipe = PAPER.changed(batch_size=pushes, steps=steps)
    features = feature_set(info.kind, simulator=True)
    network = InteractionNetwork(
        features,
        time_step=info.time_step,
        key=jax.random.key(recipe.seed),
        scales=feature_scales(batch, features),
    )
    weights = loss_weights(batch, recipe.objective)
    state = first_state(network, recipe.optimiser)
    return Problem(recipe, state, weights, even_batch(batch))
