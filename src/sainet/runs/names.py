"""What a name stands for, loaded when it is asked for.

A table leads from each name to ``module:attribute``, so that listing names loads no
JAX, and an extra that is missing costs nothing until somebody wants it.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from sainet.runs.errors import UnknownName


def load_named(kind: str, table: Mapping[str, str], name: str) -> Any:  # noqa: ANN401
    """Return the attribute that a name stands for.

    Args:
        kind: what the table holds, for the message: `engine`, say.
        table: from names to ``module:attribute``.
        name: to look up.

    Raises:
        UnknownName: the table has no such name.
    """
    if name not in table:
        available = ", ".join(sorted(table))
        raise UnknownName(f"No {kind} named {name!r}. Available: {available}.")
    module, _, attribute = table[name].partition(":")
    return getattr(import_module(module), attribute)
