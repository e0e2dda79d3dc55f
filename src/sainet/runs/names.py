"""Objects by name, loaded when they are asked for.

A table leads from each name to ``module:attribute``, so that listing names loads no
JAX, and an extra that is missing matters only when its name is asked for.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from sainet.runs.errors import unknown_name


def load_named(kind: str, table: Mapping[str, str], name: str) -> Any:  # noqa: ANN401
    """Return the attribute that belongs to a name.

    Args:
        kind: of the objects, for the message: "engine".
        table: from names to ``module:attribute``.
        name: to look up.

    Raises:
        UnknownName: the table has no such name.
    """
    if name not in table:
        raise unknown_name(kind, name, table)
    module, _, attribute = table[name].partition(":")
    return getattr(import_module(module), attribute)
