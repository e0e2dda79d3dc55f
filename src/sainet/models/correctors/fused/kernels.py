"""The kernels: all steps of a prediction, and of its gradient.

A block is held in columns, one for each disk of each push. With M' for the motion of
the other disk of a push, a step is

    x_pair = bound(own M + other M' + pair_rest)
    x_body = bound(body M + body_rest + pushed (east x + north y + gap (d - reach)))
    M(t+1) = keep M + gain f_dyn(x_body, f_rel(x_pair))

where x and y are the place of the disk and d its distance from the pusher (m).
"""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array

from sainet.models.correctors.fused.arithmetic import (
    as_place,
    bound,
    bound_gradient,
    bound_slope,
    exact,
    row,
    swapped,
    to_pusher,
)
from sainet.models.correctors.fused.layout import (
    COLUMNS,
    ROWS,
    Given,
    Inputs,
    Maps,
    Path,
    Ref,
    Settings,
    Slopes,
    Times,
    Weights,
    call,
    record,
)


class Problem(NamedTuple):
    """Everything that a prediction follows from except the weights."""

    maps: Maps
    given: Given
    times: Times

    @property
    def steps(self) -> int:
        """The number of steps."""
        return self.times.pair_rest.shape[0]

    @property
    def blocks(self) -> int:
        """The number of blocks of pushes."""
        return self.given.first.shape[0]


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def predict(settings: Settings, problem: Problem, weights: Weights) -> Path:
    """Return the motion after each step; only weights have a gradient."""
    return _predict(settings, problem, weights, is_kept=False)[0]


def _forward(
    settings: Settings, problem: Problem, weights: Weights
) -> tuple[Path, Any]:
    path, inputs = _predict(settings, problem, weights, is_kept=True)
    return path, (problem, weights, path, inputs)


def _backward(settings: Settings, kept: Any, slope: Path) -> tuple[Any, Weights]:  # noqa: ANN401
    problem, weights, path, inputs = kept
    before = jnp.concatenate([problem.given.first[None], path[:-1]])
    slopes = _slopes(settings, problem, weights, inputs, (before, slope))
    return jax.tree.map(jnp.zeros_like, problem), _by_weights(inputs, slopes)


predict.defvjp(_forward, _backward)


def _by_weights(inputs: Inputs, slopes: Slopes) -> Weights:
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


def _predict(
    settings: Settings, problem: Problem, weights: Weights, *, is_kept: bool
) -> tuple[Path, Any]:
    """Return the motion after each step and, if they are kept, all inputs."""
    steps, blocks = problem.steps, problem.blocks
    path = jax.ShapeDtypeStruct((steps, blocks, ROWS, COLUMNS), jnp.float32)
    inputs = Inputs.recorded(weights, steps, blocks) if is_kept else ()

    def kernel(*refs: Ref) -> None:
        *known, path, kept = refs
        first = known[1].first[...]

        def step(t: Array, motion: Array) -> Array:
            found, after = _step(settings, known, t, motion)
            path[t] = after
            if is_kept:
                record(kept, found, t)
            return after

        lax.fori_loop(0, steps, step, first)

    given = zip((*problem, weights), (None, 0, 1, None), strict=True)
    outputs = (path, 1), (inputs, 2)
    return call(kernel, settings, blocks, tuple(given), outputs)


def _step(
    settings: Settings, known: Sequence[Ref], t: Array, motion: Array
) -> tuple[Inputs, Array]:
    """Return the inputs of all layers at a step, and the motion after it."""
    maps, given, times, weights = known
    pair = exact(maps.own[...], motion) + exact(maps.other[...], swapped(motion))
    pair = bound(settings, pair + times.pair_rest[t])
    *rel, effect = _apply(weights.rel, weights.rel_bias, pair)
    *_, distance = to_pusher(times, t, motion)
    acting = maps.east[...] * row(motion, 0)[None]
    acting += maps.north[...] * row(motion, 1)[None]
    acting += maps.gap[...] * (distance - given.reach[...])[None]
    body = exact(maps.body[...], motion) + times.body_rest[t]
    body = bound(settings, body + given.pushed[...][None] * acting)
    added = jnp.dot(weights.effect[...], effect)
    *dyn, change = _apply(weights.dyn, weights.dyn_bias, body, added)
    after = exact(maps.keep[...], motion) + exact(maps.gain[...], change)
    return Inputs(tuple(rel), tuple(dyn), effect), after


def _apply(
    weights: Ref, biases: Ref, x: Array, added: Array | float = 0.0
) -> list[Array]:
    """Return the inputs of all layers, then the output.

    Args:
        weights: of each layer.
        biases: of each layer.
        x: the first input.
        added: to the output of the first layer.
    """
    found, last = [x], len(weights) - 1
    for index, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        x = jnp.dot(weight[...], x) + bias[...][:, None]
        x = x if index else x + added
        x = x if index == last else jnp.maximum(x, 0.0)
        found.append(x)
    return found


def _slopes(
    settings: Settings,
    problem: Problem,
    weights: Weights,
    inputs: Inputs,
    paths: tuple[Path, Path],
) -> Slopes:
    """Return the gradient by the outputs of the layers, at all steps.

    Args:
        settings: of the kernels.
        problem: of the prediction.
        weights: of the layers.
        inputs: of the layers at all steps.
        paths: motion before each step, and the gradient by the motion after it.
    """
    steps, blocks = problem.steps, problem.blocks
    turned = jax.tree.map(jnp.transpose, (problem.maps, weights))
    slopes = Slopes.recorded(weights, steps, blocks)

    def kernel(*refs: Ref) -> None:
        *known, inputs, before, slope, out = refs

        def step(done: Array, later: Array) -> Array:
            t = steps - 1 - done
            now = jax.tree.map(lambda ref: ref[:, t, :], inputs)
            after = later + slope[t]
            found, by_motion = _back(settings, known, now, t, before[t], after)
            record(out, found, t)
            return by_motion

        lax.fori_loop(0, steps, step, jnp.zeros((ROWS, COLUMNS), jnp.float32))

    trees = (*problem, *turned, inputs, *paths)
    axes = (None, 0, 1, None, None, 2, 1, 1)
    divided = tuple(zip(trees, axes, strict=True))
    (found,) = call(kernel, settings, blocks, divided, ((slopes, 2),))
    return found


def _back(
    settings: Settings, known: Sequence[Ref], now: Inputs, t: Array, *motion: Array
) -> tuple[Slopes, Array]:
    """Return the gradients by the outputs of the layers, and by the motion.

    Args:
        settings: of the kernels.
        known: the problem, then maps and weights turned.
        now: the inputs of the layers.
        t: index of the step.
        motion: before the step, and the gradient by the motion after it.
    """
    maps, given, times, turned, weights = known
    before, after = motion
    dyn, by_body = _through(weights.dyn, now.dyn, exact(turned.gain[...], after))
    rel, by_pair = _through(weights.rel, now.rel, jnp.dot(weights.effect[...], dyn[0]))
    by_body *= bound_slope(settings, now.dyn[0])
    by_pair *= bound_slope(settings, now.rel[0])
    found = exact(turned.keep[...], after) + exact(turned.body[...], by_body)
    east, north, distance = to_pusher(times, t, before)
    acting = given.pushed[...][None] * by_body
    by_gap = jnp.sum(maps.gap[...] * acting, axis=0) / distance
    by_x = jnp.sum(maps.east[...] * acting, axis=0) - by_gap * east
    by_y = jnp.sum(maps.north[...] * acting, axis=0) - by_gap * north
    found += as_place(by_x, by_y, before.shape)
    found += exact(turned.own[...], by_pair)
    found += swapped(exact(turned.other[...], by_pair))
    return Slopes(rel, dyn), bound_gradient(found, maps.sizes[...])


def _through(
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
