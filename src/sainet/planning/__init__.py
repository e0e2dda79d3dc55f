"""Planners: the paper's greedy search, and the full tree."""

from typing import TYPE_CHECKING

from sainet.runs.errors import BadSetting
from sainet.runs.names import load_named

if TYPE_CHECKING:
    from sainet.planning.base import AbstractPlanner

PLANNERS = {
    "greedy": "sainet.planning.greedy:GreedyPlanner",
    "tree": "sainet.planning.tree:TreePlanner",
}


def make_planner(
    name: str, *, deadline: float | None = None, expected: bool = False
) -> "AbstractPlanner":
    """Return a planner with its default settings.

    Args:
        name: `greedy` (the paper's search) or `tree` (every sequence of two pushes).
        deadline: time after which the best plan so far is used, s; only for `tree`.
        expected: judge pushes by the mean cost over the regions of the model, a
            Gaussian process or an ensemble.

    Raises:
        UnknownName: no planner has this name.
        BadSetting: the planner accepts no deadline.
    """
    planner = load_named("planner", PLANNERS, name)
    if deadline is None:
        return planner(expected=expected)
    if name != "tree":
        raise BadSetting("deadline", deadline, "None unless `planner` is tree")
    return planner(deadline=deadline, expected=expected)
