"""From networks to kernels: the inputs of IN and SAIN are affine in the motion.

All but the gap between pusher and disk, which has a term of its own.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.models.blocks import PathAction
from sainet.models.correctors.fused.kernels import Problem, predict
from sainet.models.correctors.fused.layout import (
    COLUMNS,
    DISKS,
    PUSHES,
    ROWS,
    Given,
    Maps,
    Path,
    Settings,
    Times,
    Weights,
)
from sainet.models.correctors.interaction import InteractionNetwork
from sainet.models.correctors.network import AbstractNetwork
from sainet.models.features import FeatureSet
from sainet.models.inputs import Drive, Moment, Still, in_columns
from sainet.models.integrators import GRADIENT_SIZES, Acceleration


def fits(network: AbstractNetwork, disks: int) -> bool:
    """Return whether the kernels predict with this network: IN or SAIN, two disks."""
    return (
        isinstance(network, InteractionNetwork)
        and isinstance(network.integrator, Acceleration)
        and not network.features.has_place
        and max(network.features.pair_size, network.features.body_size) <= ROWS
        and disks == DISKS
    )


def unroll_fused(
    network: InteractionNetwork,
    initial: Float[Array, "push body 6"],
    still: Still,
    drive: Drive,
    *,
    before: Float[Array, "push body 6"] | None = None,
    interpret: bool = False,
) -> Float[Array, "time push body 6"]:
    """Predict like `network.unroll` does, for a network that `fits`.

    Only its layers have a gradient. Products have the default precision of the device:
    TF32 on a GPU, as those of XLA.

    Args:
        network: IN or SAIN.
        initial: packed motion at the start.
        still: for each push.
        drive: with axes ``[push, time, ...]``.
        before: not used.
        interpret: run without a GPU, slowly, for tests.
    """
    del before
    settings = Settings(network.features.are_bounded, interpret)
    problem = _problem(network, initial, still, drive)
    path: Path = predict(settings, problem, _weights(network))  # pyright: ignore[reportAssignmentType]
    return _from_blocks(path)[:, : initial.shape[0]]


def _from_blocks(path: Path) -> Float[Array, "time push body 6"]:
    steps, blocks = path.shape[:2]
    apart = path[:, :, :6].reshape(steps, blocks, 6, DISKS, PUSHES)
    return jnp.transpose(apart, (0, 1, 4, 3, 2)).reshape(steps, -1, DISKS, 6)


def _to_blocks(
    x: Float[Array, "number body push"], rows: int = ROWS
) -> Float[Array, "block row column"]:
    x = jnp.pad(x, ((0, rows - x.shape[0]), (0, 0), (0, 0)))
    apart = x.reshape(rows, DISKS, -1, PUSHES)
    return jnp.transpose(apart, (2, 0, 1, 3)).reshape(-1, rows, COLUMNS)


def _gap_row(features: FeatureSet) -> int | None:
    """Return the place of the gap among the inputs of f_dyn, if it is one."""
    start = 0
    for block in features.blocks:
        start += block.body_size
        if isinstance(block, PathAction):
            return start - 1
    return None


@lru_cache
def _jacobians(features: FeatureSet, actions: int) -> tuple[np.ndarray, ...]:
    """Return the derivatives ``[input motion]`` of all inputs but the gap.

    Of pairs by the own and the other motion; of bodies that are not pushed, and what
    pushing adds. An action has so many numbers.
    """
    with jax.ensure_compile_time_eval():
        pair = _jacobian(features.of_pairs, actions, 0.0)[:, 0, 0, 0]
        body, pushed = (
            _jacobian(features.of_bodies, actions, share)[:, 0, 0, :, 0, 0]
            for share in (0.0, 1.0)
        )
    added = pushed - body
    if (row := _gap_row(features)) is not None:
        added[row] = 0.0
    return pair[:, :, 0, 0], pair[:, :, 1, 0], body, added


def _jacobian(
    function: Callable[[Moment], Array], actions: int, pushed: float
) -> np.ndarray:
    """Return the derivative by the motion of two disks at rest, all other inputs 0."""
    one, two = jnp.ones((1,)), jnp.ones((DISKS, 1))
    none = jnp.zeros((3, DISKS, 1))
    drive = Drive(jnp.zeros((actions, 1)), jnp.zeros((2, 1)), none, none)
    still = Still(two, two, pushed * two, one, jnp.zeros((2, 1)), jnp.ones((2, 1)))
    at = lambda motion: function(Moment(motion, still, drive))  # noqa: E731
    return np.array(jax.jacfwd(at)(jnp.zeros((6, DISKS, 1))))


def _maps(network: InteractionNetwork, actions: int) -> Maps:
    features, scales, step = network.features, network.scales, network.time_step
    own, other, body, added = map(jnp.asarray, _jacobians(features, actions))
    gap = jnp.zeros((features.body_size, 1))
    if (row := _gap_row(features)) is not None:
        gap = gap.at[row].set(1.0)
    if features.are_standardised:
        pair, each = scales.pair_deviation[:, None], scales.body_deviation[:, None]
        own, other = own / pair, other / pair
        body, added, gap = body / each, added / each, gap / each
    rate = step * jnp.diag(scales.acceleration)
    return Maps(
        own=_square(own),
        other=_square(other),
        body=_square(body),
        keep=_square(jnp.eye(6) + step * jnp.eye(6, k=3)),
        gain=_square(jnp.concatenate([step * rate, rate])),
        east=_repeated(added[:, 0:1]),
        north=_repeated(added[:, 1:2]),
        gap=_repeated(gap),
        sizes=_repeated(jnp.array(GRADIENT_SIZES)[:, None]),
    )


def _square(matrix: Array) -> Float[Array, "16 16"]:
    rows, columns = matrix.shape
    return jnp.pad(matrix, ((0, ROWS - rows), (0, ROWS - columns)))


def _repeated(column: Float[Array, "row 1"]) -> Float[Array, "16 16"]:
    return _square(jnp.broadcast_to(column, (column.shape[0], COLUMNS)))


def _problem(
    network: InteractionNetwork, initial: Array, still: Still, drive: Drive
) -> Problem:
    extra = -initial.shape[0] % PUSHES

    def filled(x: Array) -> Array:
        return jnp.pad(x, ((0, extra), *((0, 0),) * (x.ndim - 1)), mode="edge")

    initial, still, drive = jax.tree.map(filled, (initial, still, drive))
    start, fixed = in_columns((initial, still))
    reach = fixed.radius + fixed.pusher_radius[None]
    given = Given(
        first=_to_blocks(start),
        pushed=_to_blocks(fixed.pushed[None], rows=1)[:, 0],
        reach=_to_blocks(reach[None], rows=1)[:, 0],
    )
    by_time = jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0), drive)
    still_start = jnp.zeros_like(start)

    def at(now: Drive) -> Times:
        moment = Moment(still_start, fixed, in_columns(now))
        pusher = (
            jnp.zeros((2, initial.shape[0])) if now.pusher is None else now.pusher.T
        )
        each = jnp.broadcast_to(pusher[:, None], (2, *fixed.radius.shape))
        return Times(*_rests(network, moment), _to_blocks(each, rows=2))

    maps = _maps(network, drive.action.shape[-1])
    return Problem(maps, given, jax.vmap(at)(by_time))


def _rests(network: InteractionNetwork, still: Moment) -> tuple[Array, Array]:
    """Return the inputs at a moment without motion, in blocks."""
    features, scales = network.features, network.scales
    pair, body = features.of_pairs(still)[:, 0], features.of_bodies(still)
    if (row := _gap_row(features)) is not None:
        body = body.at[row].set(0.0)

    def scaled(x: Array, mean: Array, deviation: Array) -> Array:
        if not features.are_standardised:
            return x
        return (x - mean[:, None, None]) / deviation[:, None, None]

    pair = scaled(pair, scales.pair_mean, scales.pair_deviation)
    body = scaled(body, scales.body_mean, scales.body_deviation)
    return _to_blocks(pair), _to_blocks(body)


def _weights(network: InteractionNetwork) -> Weights:
    size, rel, dyn = network.features.body_size, network.rel, network.dyn
    first, *others = dyn.weights
    return Weights(
        rel=_filled(rel.weights),
        rel_bias=rel.biases,
        dyn=_filled((first[:size], *others)),
        dyn_bias=(*dyn.biases[:-1], jnp.pad(dyn.biases[-1], (0, ROWS - 3))),
        effect=first[size:].T,
    )


def _filled(weights: Sequence[Array]) -> tuple[Array, ...]:
    """Return the transposed weights with at least 16 inputs and outputs."""
    return tuple(
        jnp.pad(w.T, [(0, max(0, ROWS - size)) for size in w.T.shape]) for w in weights
    )
