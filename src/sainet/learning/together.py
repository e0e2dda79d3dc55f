"""Several networks that train at once on a GPU, which one alone leaves mostly idle."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array

from sainet.learning.job import Job, finish
from sainet.learning.mixture import Batches
from sainet.learning.step import FitState, Side, step_together
from sainet.runs.errors import Diverged
from sainet.runs.interrupts import raise_if_interrupted

_T = TypeVar("_T")


def fit_together(
    jobs: Sequence[Job],
    on_step: Callable[[int, float | None], None] = lambda iteration, loss: None,
) -> None:
    """Train networks at once where they are alike, and finish their runs.

    Each becomes what it would have become alone, except in its last bits. A job whose
    loss diverges is left as it is, so that it reports its error when it runs alone.

    Args:
        jobs: each of one dataset. They are alike if their networks and batches have
            the same form, and their optimisers are the same.
        on_step: called with the finished iterations of each, and a last logged loss.
    """
    for job in jobs:
        if not job.left:  # interrupted after its last iteration
            finish(job)
    members = [_Member(job) for job in jobs if job.left]
    try:
        for alike in _alike(members, lambda member: member.form):
            _iterate(alike, on_step)
    finally:
        for member in members:
            member.close()


def _alike(items: Iterable[_T], form: Callable[[_T], object]) -> Iterable[list[_T]]:
    groups: dict[object, list[_T]] = {}
    for item in items:
        groups.setdefault(form(item), []).append(item)
    return groups.values()


class _Member:
    """A job, its batches, and what its steps need for themselves."""

    def __init__(self, job: Job) -> None:
        self.job, self._batches = job, Batches(job.mixture)
        self._l2 = jnp.float32(job.recipe.objective.l2)

    @property
    def form(self) -> tuple[object, ...]:
        """What members have in common that train together."""
        recipe, form = self.job.recipe, _form(self.side(self.job.left.start))
        return recipe.optimiser, recipe.horizon, self.job.left, form

    def side(self, iteration: int) -> Side:
        """Return the state, and the inputs of an iteration."""
        job, (_, batch) = self.job, self._batches.take(iteration)
        state, (weights,) = job.progress.state, job.weights
        return Side(state, batch, weights, job.drawn_to, self._l2)

    def close(self) -> None:
        """Stop reading."""
        self._batches.close()


def _form(side: Side) -> object:
    """Return what sides have in common that are stacked, such as numbers of steps."""
    shapes = [(x.shape, x.dtype) for x in jax.tree.leaves(side)]
    return jax.tree.structure(side), tuple(shapes)


def _iterate(
    members: list[_Member], on_step: Callable[[int, float | None], None]
) -> None:
    recipe = members[0].job.recipe
    for iteration in members[0].job.left:
        raise_if_interrupted()
        sides = [(member, member.side(iteration)) for member in members]
        members = []
        for alike in _alike(sides, lambda each: _form(each[1])):
            some, inputs = zip(*alike, strict=True)
            found = step_together(recipe.optimiser, recipe.horizon.hold, inputs)
            members += _noted(some, iteration, found)
        if not members:
            return
        on_step(iteration, members[0].job.progress.last_loss)
    for member in members:
        finish(member.job)


def _noted(
    members: Sequence[_Member], iteration: int, found: Sequence[tuple[FitState, Array]]
) -> Iterator[_Member]:
    """Yield the members that go on; finish those that end early."""
    for member, (state, loss) in zip(members, found, strict=True):
        member.job.progress.state = state
        try:
            is_over = member.job.note(iteration, loss)
        except Diverged:
            continue
        if is_over:
            finish(member.job)
        else:
            yield member
