"""Runtime checks of annotations, as many as tests can afford.

A check takes longer than most functions that a simulation calls at every step. In each
test, the first 200 calls of a function are checked, then every fiftieth. Each test
counts from the start, so that it checks the same calls alone and in the suite.
"""

from functools import partial, wraps
from inspect import iscoroutinefunction, isfunction, isgeneratorfunction
from itertools import count

import jaxtyping
from jaxtyping import jaxtyped

FIRST, EVERY = 200, 50
_tests = count(1)
_now = [0]  # number of this test


def begin_test() -> None:
    """Check the next calls of every function."""
    _now[0] = next(_tests)


def install() -> None:
    """Make jaxtyping's import hook check functions like this."""
    jaxtyping.jaxtyped = _sampled


def _sampled(fn=None, /, *, typechecker):
    if fn is None:
        return partial(_sampled, typechecker=typechecker)
    checked = jaxtyped(fn, typechecker=typechecker)
    if not isfunction(fn) or iscoroutinefunction(fn) or isgeneratorfunction(fn):
        return checked
    test = calls = 0

    @wraps(fn)
    def sampled(*arguments, **named):
        nonlocal test, calls
        if test != _now[0]:
            test, calls = _now[0], 0
        calls += 1
        if calls <= FIRST or calls % EVERY == 0:
            return checked(*arguments, **named)
        return fn(*arguments, **named)

    return sampled
