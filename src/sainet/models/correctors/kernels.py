"""Kernels for a GPU: all steps of a prediction in one, and of its gradient in one.

A step of a small network is so short that starting its thirty operations takes longer
than computing them. Here a block of pushes stays in one kernel from its first step to
its last (Pallas, through Triton).

A block is held in columns, one for each disk of each push. With M' for the motion of
the other disk of a push, a step is

    x_pair = bound(own M + other M' + pair_rest)
    x_body = bound(body M + body_rest + pushed (east x + north y + gap (d - reach)))
    M(t+1) = keep M + gain f_dyn(x_body, f_rel(x_pair))

where x and y are the place of the disk and d its distance from the pusher (m).
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jax.experimental import pallas as pl
from jax.experimental.pallas import triton
from jaxtyping import Array, Float

from sainet.models.correctors.network import FEATURE_BOUND
from sainet.models.integrators import GRADIENT_BOUND

DISKS = 2
PUSHES = 8  # of a block
COLUMNS = DISKS * PUSHES  # the least size of a product in Triton
ROWS = 16  # likewise: the six numbers of packed motion, or inputs, and zeros
_OVERFLOW = 1e30  # what is larger counts as infinite
_WARPS = 4  # the fastest of 2, 4 and 8 on an H200

Ref = Any  # of Pallas: an array in the memory of the device
Path = Float[Array, "time block row column"]


class Maps(NamedTuple):
    """What is the same at every step: matrices ``[16 16]``."""

    own: Array
    other: Array
    body: Array
    keep: Array
    gain: Array
    # Of equal columns: inputs of f_dyn by x (1/m), y (1/m) and gap (1/m), and the sizes
    # of motion that bound its gradient.
    east: Array
    north: Array
    gap: Array
    sizes: Array


class Given(NamedTuple):
    """What comes from outside, for each block."""

    first: Float[Array, "block row column"]  # motion at the start
    pair_rest: Path
    body_rest: Path
    pusher: Float[Array, "time block 2 column"]  # m
    pushed: Float[Array, "block column"]  # 1 for the pushed disk
    reach: Float[Array, "block column"]  # m, the radii of disk and pusher


class Weights(NamedTuple):
    """Of the layers ``[output input]`` and ``[output]``; sizes are powers of two."""

    rel: tuple[Array, ...]
    rel_bias: tuple[Array, ...]
    dyn: tuple[Array, ...]  # the first one takes the inputs of a body
    dyn_bias: tuple[Array, ...]
    effect: Array  # the rest of the first layer, which takes the summed effects


class _Inputs(NamedTuple):
    """Of the layers, ``[input column]`` at a step."""

    rel: tuple[Array, ...]
    dyn: tuple[Array, ...]
    effect: Array


class _Slopes(NamedTuple):
    """Of the loss by the outputs of the layers before ReLU, ``[output column]``."""

    rel: tuple[Array, ...]
    dyn: tuple[Array, ...]


class Settings(NamedTuple):
    """How the kernels are compiled."""

    is_bounded: bool  # the inputs of the layers
    interpret: bool = False  # without a GPU, slowly, for tests


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def predict(settings: Settings, maps: Maps, given: Given, weights: Weights) -> Path:
    """Return the motion after each step; only weights have a gradient."""
    return _predict(settings, maps, given, weights, is_kept=False)[0]


def _forward(
    settings: Settings, maps: Maps, given: Given, weights: Weights
) -> tuple[Path, Any]:
    path, inputs = _predict(settings, maps, given, weights, is_kept=True)
    return path, (maps, given, weights, path, inputs)


def _backward(settings: Settings, kept: Any, slope: Path) -> tuple[Any, Any, Weights]:  # noqa: ANN401
    maps, given, weights, path, inputs = kept
    slopes = _slopes(settings, maps, given, weights, path, inputs, slope)
    nothing = jax.tree.map(jnp.zeros_like, (maps, given))
    return (*nothing, _by_weights(inputs, slopes))


predict.defvjp(_forward, _backward)


def _by_weights(inputs: _Inputs, slopes: _Slopes) -> Weights:
    """Return the gradient by the weights: products over all steps and pushes."""

    def product(slope: Array, x: Array) -> Array:
        return slope.reshape(slope.shape[0], -1) @ x.reshape(x.shape[0], -1).T

    def total(slope: Array) -> Array:
        return jnp.sum(slope, axis=(1, 2, 3))

    return Weights(
        rel=tuple(map(product, slopes.rel, inputs.rel)),
        rel_bias=tuple(map(total, slopes.rel)),
        dyn=tuple(map(product, slopes.dyn, inputs.dyn)),
        dyn_bias=tuple(map(total, slopes.dyn)),
        effect=product(slopes.dyn[0], inputs.effect),
    )


# Prediction


def _predict(
    settings: Settings, maps: Maps, given: Given, weights: Weights, *, is_kept: bool
) -> tuple[Path, Any]:
    """Return the motion after each step and, if they are kept, all inputs."""
    steps, blocks = given.pair_rest.shape[:2]
    path = jax.ShapeDtypeStruct((steps, blocks, ROWS, COLUMNS), jnp.float32)
    inputs = _recorded(_in_sizes(weights), steps, blocks) if is_kept else ()
    return _call(
        partial(_predict_block, settings, steps),
        settings,
        (maps, given, weights),
        (_shared(maps), _given_specs(given), _shared(weights)),
        (path, inputs),
        (_of_block(1)(path), jax.tree.map(_of_block(2), inputs)),
    )


def _predict_block(
    settings: Settings, steps: int, maps: Ref, given: Ref, weights: Ref, out: Ref
) -> None:
    path, inputs = out

    def step(t: Array, motion: Array) -> Array:
        found, after = _step(settings, maps, given, weights, t, motion)
        path[t] = after
        if inputs:
            _record(inputs, found, t)
        return after

    lax.fori_loop(0, steps, step, given.first[...])


def _step(
    settings: Settings, maps: Ref, given: Ref, weights: Ref, t: Array, motion: Array
) -> tuple[_Inputs, Array]:
    """Return the inputs of all layers at a step, and the motion after it."""
    other = _exact(_finite(motion), _swap())
    pair = _exact(maps.own[...], motion) + _exact(maps.other[...], other)
    pair = _bound(settings, pair + given.pair_rest[t])
    *rel, effect = _apply(weights.rel, weights.rel_bias, pair)
    x, y = _row(motion, 0), _row(motion, 1)
    *_, distance = _to_pusher(given, t, motion)
    body = _exact(maps.body[...], motion) + given.body_rest[t]
    acting = maps.east[...] * x[None] + maps.north[...] * y[None]
    acting += maps.gap[...] * (distance - given.reach[...])[None]
    body = _bound(settings, body + given.pushed[...][None] * acting)
    before = jnp.dot(weights.effect[...], effect)
    *dyn, change = _apply(weights.dyn, weights.dyn_bias, body, before)
    after = _exact(maps.keep[...], motion) + _exact(maps.gain[...], change)
    return _Inputs(tuple(rel), tuple(dyn), effect), after


def _apply(
    weights: Ref, biases: Ref, x: Array, before: Array | None = None
) -> list[Array]:
    """Return the inputs of all layers, then the output; `before` is added to the first."""
    found = [x]
    for index, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        x = jnp.dot(weight[...], x) + bias[...][:, None]
        x = x if index or before is None else x + before
        x = x if index == len(weights) - 1 else jnp.maximum(x, 0.0)
        found.append(x)
    return found


# Gradient


def _slopes(
    settings: Settings,
    maps: Maps,
    given: Given,
    weights: Weights,
    path: Path,
    inputs: _Inputs,
    slope: Path,
) -> _Slopes:
    """Return the gradient by the outputs of the layers at all steps."""
    steps, blocks = path.shape[:2]
    before = jnp.concatenate([given.first[None], path[:-1]])
    turned = jax.tree.map(jnp.transpose, (maps, weights))
    out = _recorded(_out_sizes(weights), steps, blocks)
    paths = (before, slope)
    return _call(
        partial(_slopes_of_block, settings, steps),
        settings,
        (maps, *turned, given, inputs, *paths),
        (
            *map(_shared, (maps, *turned)),
            _given_specs(given),
            jax.tree.map(_of_block(2), inputs),
            *map(_of_block(1), paths),
        ),
        out,
        jax.tree.map(_of_block(2), out),
    )


def _slopes_of_block(
    settings: Settings,
    steps: int,
    maps: Ref,
    turned: Ref,
    weights: Ref,
    given: Ref,
    inputs: Ref,
    motion: Ref,
    slope: Ref,
    out: Ref,
) -> None:
    def step(done: Array, later: Array) -> Array:
        t = steps - 1 - done
        after = later + slope[t]
        now = jax.tree.map(lambda ref: ref[:, t, :], inputs)
        dyn, by_body = _back(weights.dyn, now.dyn, _exact(turned.gain[...], after))
        by_effect = jnp.dot(weights.effect[...], dyn[0])
        rel, by_pair = _back(weights.rel, now.rel, by_effect)
        _record(out, _Slopes(rel, dyn), t)
        if settings.is_bounded:
            by_body *= 1.0 - (now.dyn[0] / FEATURE_BOUND) ** 2
            by_pair *= 1.0 - (now.rel[0] / FEATURE_BOUND) ** 2
        by_motion = _exact(turned.keep[...], after)
        by_motion += _exact(turned.body[...], by_body)
        by_motion += _by_place(maps, given, t, motion[t], by_body)
        by_motion += _exact(turned.own[...], by_pair)
        by_other = _exact(turned.other[...], by_pair)
        by_motion += _exact(_finite(by_other), _swap())
        return _bounded(by_motion, maps.sizes[...])

    lax.fori_loop(0, steps, step, jnp.zeros((ROWS, COLUMNS), jnp.float32))


def _back(
    weights: Ref, inputs: Sequence[Array], slope: Array
) -> tuple[tuple[Array, ...], Array]:
    """Return the gradients by the outputs of layers, and by the first input."""
    found = [slope]
    for index in reversed(range(len(inputs))):
        slope = jnp.dot(weights[index][...], slope)
        if index:
            slope = jnp.where(inputs[index] > 0, slope, 0.0)
            found.append(slope)
    return tuple(reversed(found)), slope


def _by_place(maps: Ref, given: Ref, t: Array, motion: Array, by_body: Array) -> Array:
    """Return the gradient by the place of the pushed disk, relative to the pusher."""
    pushed, (east, north, distance) = given.pushed[...], _to_pusher(given, t, motion)
    by_gap = jnp.sum(maps.gap[...] * by_body, axis=0) / distance
    by_x = jnp.sum(maps.east[...] * by_body, axis=0) - by_gap * east
    by_y = jnp.sum(maps.north[...] * by_body, axis=0) - by_gap * north
    row = lax.broadcasted_iota(jnp.int32, motion.shape, 0)
    rest = jnp.where(row == 1, (pushed * by_y)[None], 0.0)
    return jnp.where(row == 0, (pushed * by_x)[None], rest)


def _bounded(slope: Array, sizes: Array) -> Array:
    """Bound the gradient of each push, as `integrators.bound_gradient` does."""
    squared = (slope * sizes) ** 2
    squared = jnp.where(squared < _OVERFLOW, squared, _OVERFLOW)
    each = _exact(jnp.ones((ROWS, ROWS), jnp.float32), squared)
    whole = each + _exact(each, _swap())
    share = jnp.minimum(1.0, GRADIENT_BOUND * lax.rsqrt(jnp.maximum(whole, 1e-30)))
    usable = (whole < _OVERFLOW) & (jnp.abs(slope) < _OVERFLOW)
    return jnp.where(usable, slope * share, 0.0)


# Parts of both


def _exact(a: Array, b: Array) -> Array:
    return jnp.dot(a, b, precision=lax.Precision.HIGHEST)


def _swap() -> Array:
    """Return the matrix that exchanges the columns of both disks."""
    row = lax.broadcasted_iota(jnp.int32, (COLUMNS, COLUMNS), 0)
    column = lax.broadcasted_iota(jnp.int32, (COLUMNS, COLUMNS), 1)
    other = jnp.where(column < PUSHES, column + PUSHES, column - PUSHES)
    return jnp.where(row == other, 1.0, 0.0)


def _finite(x: Array) -> Array:
    """Replace what overflowed: a product would spread it to the other pushes."""
    return jnp.where(jnp.abs(x) < _OVERFLOW, x, _OVERFLOW)


def _row(x: Array, index: int) -> Array:
    row = lax.broadcasted_iota(jnp.int32, x.shape, 0)
    return jnp.sum(jnp.where(row == index, x, 0.0), axis=0)


def _to_pusher(given: Ref, t: Array, motion: Array) -> tuple[Array, Array, Array]:
    """Return offset and distance of the pusher (m)."""
    east, north = (given.pusher[t, i] - _row(motion, i) for i in range(2))
    return east, north, jnp.sqrt(east**2 + north**2 + 1e-12)


def _bound(settings: Settings, x: Array) -> Array:
    return FEATURE_BOUND * jnp.tanh(x / FEATURE_BOUND) if settings.is_bounded else x


def _record(refs: Any, found: Any, t: Array) -> None:  # noqa: ANN401
    """Store arrays of a step."""
    for ref, value in zip(jax.tree.leaves(refs), jax.tree.leaves(found), strict=True):
        ref[:, t, :] = value


def _in_sizes(weights: Weights) -> _Inputs:
    rel, dyn = (tuple(w.shape[1] for w in part) for part in (weights.rel, weights.dyn))
    return _Inputs(rel, dyn, weights.effect.shape[1])  # pyright: ignore[reportArgumentType]


def _out_sizes(weights: Weights) -> _Slopes:
    rel, dyn = (tuple(w.shape[0] for w in part) for part in (weights.rel, weights.dyn))
    return _Slopes(rel, dyn)  # pyright: ignore[reportArgumentType]


def _recorded(sizes: Any, steps: int, blocks: int) -> Any:  # noqa: ANN401
    """Return arrays ``[row time block column]`` of so many rows."""

    def shape(rows: int) -> jax.ShapeDtypeStruct:
        return jax.ShapeDtypeStruct((rows, steps, blocks, COLUMNS), jnp.float32)

    return jax.tree.map(shape, sizes)


def _shared(tree: Any) -> Any:  # noqa: ANN401
    """Return that every block sees arrays as a whole."""
    return jax.tree.map(lambda x: pl.BlockSpec(x.shape, lambda _: (0,) * x.ndim), tree)


def _of_block(axis: int) -> Callable[[Any], pl.BlockSpec]:
    """Return that every block sees its own part of an array along an axis."""

    def spec(x: Any) -> pl.BlockSpec:  # noqa: ANN401
        shape = tuple(None if i == axis else size for i, size in enumerate(x.shape))
        return pl.BlockSpec(
            shape, lambda block: tuple(block * (i == axis) for i in range(len(shape)))
        )

    return spec


def _given_specs(given: Given) -> Given:
    axes = Given(first=0, pair_rest=1, body_rest=1, pusher=1, pushed=0, reach=0)  # pyright: ignore[reportArgumentType]
    return jax.tree.map(lambda axis, x: _of_block(axis)(x), axes, given)


def _call(
    kernel: Callable[..., None],
    settings: Settings,
    inputs: Any,  # noqa: ANN401
    specs: Any,  # noqa: ANN401
    out: Any,  # noqa: ANN401
    out_specs: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    given = next(part for part in inputs if isinstance(part, Given))

    def whole(*refs: Ref) -> None:
        kernel(
            *refs[: len(inputs)],
            jax.tree.unflatten(treedef, jax.tree.leaves(refs[len(inputs) :])),
        )

    treedef = jax.tree.structure(out)
    return pl.pallas_call(
        whole,
        out_shape=out,
        in_specs=specs,
        out_specs=out_specs,
        grid=(given.first.shape[0],),
        interpret=settings.interpret,
        compiler_params=triton.CompilerParams(num_warps=_WARPS, num_stages=1),
    )(*inputs)
