"""Objects by name, loaded on request.

A table maps each name to ``module:attribute``, so that listing names does not import
JAX, and a missing extra matters only when its name is requested.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from sainet.runs.errors import unknown_name


def load_named(kind: str, table: Mapping[str, str], name: str) -> Any:  # noqa: ANN401
    """Return the object with a name.

    Args:
        kind: kind of the objects for the message, for example "engine".
        table: maps names to ``module:attribute``.
        name: name to look up.

    Raises:
        UnknownName: the table does not contain the name.
    """
    if name not in table:
        raise unknown_name(kind, name, table)
    module, _, attribute = table[name].partition(":")
    return getattr(import_module(module), attribute)
