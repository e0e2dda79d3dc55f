"""What the kernels read and write, and how it is divided into blocks of pushes."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.experimental import pallas as pl
from jax.experimental.pallas import triton
from jaxtyping import Array, Float

DISKS = 2
PUSHES = 8  # of a block
COLUMNS = DISKS * PUSHES  # the least size of a product in Triton
ROWS = 16  # likewise: the six numbers of packed motion, or inputs, and zeros
_WARPS = 4  # the fastest of 2, 4 and 8 on an H200

Ref = Any  # of Pallas: an array in the memory of the device
Path = Float[Array, "time block row column"]


class Settings(NamedTuple):
    """How the kernels are compiled."""

    is_bounded: bool  # the inputs of the layers
    interpret: bool = False  # without a GPU, slowly, for tests


class Maps(NamedTuple):
    """Matrices ``[16 16]``, the same at every step; see `kernels`."""

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
    """What stays the same during the pushes of each block."""

    first: Float[Array, "block row column"]  # motion at the start
    pushed: Float[Array, "block column"]  # 1 for the pushed disk
    reach: Float[Array, "block column"]  # m, the radii of disk and pusher


class Times(NamedTuple):
    """What comes from outside at each step."""

    pair_rest: Path  # inputs without motion
    body_rest: Path
    pusher: Float[Array, "time block 2 column"]  # m


class Weights(NamedTuple):
    """Of the layers ``[output input]`` and ``[output]``; sizes are powers of two."""

    rel: tuple[Array, ...]
    rel_bias: tuple[Array, ...]
    dyn: tuple[Array, ...]  # the first one takes the inputs of a body
    dyn_bias: tuple[Array, ...]
    effect: Array  # the rest of the first layer, which takes the summed effects


class Inputs(NamedTuple):
    """Of the layers, ``[input column]`` at a step."""

    rel: tuple[Any, ...]
    dyn: tuple[Any, ...]
    effect: Any

    @staticmethod
    def recorded(weights: Weights, steps: int, blocks: int) -> "Inputs":
        """Return the shapes of the inputs at all steps."""
        rel, dyn = _recorded_of(weights, 1, steps, blocks)
        return Inputs(rel, dyn, _recorded(weights.effect.shape[1], steps, blocks))


class Slopes(NamedTuple):
    """Of the loss by the outputs of the layers before ReLU, ``[output column]``."""

    rel: tuple[Any, ...]
    dyn: tuple[Any, ...]

    @staticmethod
    def recorded(weights: Weights, steps: int, blocks: int) -> "Slopes":
        """Return the shapes of the slopes at all steps."""
        return Slopes(*_recorded_of(weights, 0, steps, blocks))


def _recorded_of(weights: Weights, axis: int, steps: int, blocks: int) -> Any:  # noqa: ANN401
    """Return shapes for f_rel and f_dyn, by an axis of the weights."""
    return (
        tuple(_recorded(weight.shape[axis], steps, blocks) for weight in part)
        for part in (weights.rel, weights.dyn)
    )


def _recorded(rows: int, steps: int, blocks: int) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct((rows, steps, blocks, COLUMNS), jnp.float32)


def record(refs: Any, found: Any, t: Array) -> None:  # noqa: ANN401
    """Store the arrays of a step among those of all steps."""
    for ref, value in zip(jax.tree.leaves(refs), jax.tree.leaves(found), strict=True):
        ref[:, t, :] = value


Divided = tuple[Any, int | None]  # a tree, and the axis of blocks of all its arrays


def call(
    kernel: Callable[..., None],
    settings: Settings,
    blocks: int,
    inputs: Sequence[Divided],
    outputs: Sequence[Divided],
) -> Any:  # noqa: ANN401
    """Run a kernel for each block.

    Args:
        kernel: takes references to the inputs, then to the outputs.
        settings: of its compilation.
        blocks: how many there are.
        inputs: trees of arrays; an axis of None gives every block the whole.
        outputs: trees of shapes.

    Returns:
        The outputs.
    """
    return pl.pallas_call(
        kernel,
        out_shape=tuple(tree for tree, _ in outputs),
        in_specs=[_specs(*each) for each in inputs],
        out_specs=tuple(_specs(*each) for each in outputs),
        grid=(blocks,),
        interpret=settings.interpret,
        compiler_params=triton.CompilerParams(num_warps=_WARPS, num_stages=1),
    )(*(tree for tree, _ in inputs))


def _specs(tree: Any, axis: int | None) -> Any:  # noqa: ANN401
    def spec(x: Any) -> pl.BlockSpec:  # noqa: ANN401
        shape = tuple(None if i == axis else size for i, size in enumerate(x.shape))
        return pl.BlockSpec(
            shape, lambda block: tuple(block * (i == axis) for i in range(len(shape)))
        )

    return jax.tree.map(spec, tree)
