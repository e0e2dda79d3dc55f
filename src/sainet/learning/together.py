"""Several networks that train at once on a GPU, which one alone leaves mostly idle."""

from collections.abc import Callable, Iterable, Iterator, Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array

from sainet.learning.job import Job, finish
from sainet.learning.mixture import Batches
from sainet.learning.recipes import Recipe
from sainet.learning.step import FitState, Side, step_together
from sainet.runs.errors import Diverged
from sainet.runs.interrupts import raise_if_interrupted


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
        for alike in _alike(members):
            _iterate(alike, on_step)
    finally:
        for member in members:
            member.close()


def _alike(members: Sequence["_Member"]) -> Iterable[list["_Member"]]:
    groups: dict[object, list[_Member]] = {}
    for member in members:
        groups.setdefault(member.form, []).append(member)
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
    shapes = [(x.shape, x.dtype) for x in jax.tree.leaves(side)]
    return jax.tree.structure(side), tuple(shapes)


def _step(recipe: Recipe, sides: Sequence[Side]) -> list[tuple[FitState, Array]]:
    """Return next states and losses; batches of one number of steps go at once."""
    alike: dict[object, list[int]] = {}
    for number, side in enumerate(sides):
        alike.setdefault(_form(side), []).append(number)
    found: dict[int, tuple[FitState, Array]] = {}
    for numbers in alike.values():
        some = tuple(sides[number] for number in numbers)
        after = step_together(recipe.optimiser, recipe.horizon.hold, some)
        found |= zip(numbers, after, strict=True)
    return [found[number] for number in range(len(sides))]


def _iterate(
    members: list[_Member], on_step: Callable[[int, float | None], None]
) -> None:
    recipe = members[0].job.recipe
    for iteration in members[0].job.left:
        raise_if_interrupted()
        found = _step(recipe, [member.side(iteration) for member in members])
        members = list(_noted(members, iteration, found))
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
