"""Simulator-augmented interaction networks for planar pushing.

The names in ``__init__.pyi`` are loaded when first used, so that ``import sainet``
costs nothing and has no side effects.
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

from sainet.control.gym.registration import register_when_imported

__version__ = "0.1.0"

# Each public name with its module and its name there.
_HOMES = {
    alias.asname or alias.name: (node.module, alias.name)
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_text("utf-8")).body
    if isinstance(node, ast.ImportFrom) and node.module
    for alias in node.names
}
__all__ = sorted(_HOMES)  # noqa: PLE0605  # pyright: ignore[reportUnsupportedDunderAll]

register_when_imported()


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Load a public name from its home when it is first asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module 'sainet' has no attribute {name!r}")
    module, attribute = _HOMES[name]
    return getattr(import_module(module), attribute)


def __dir__() -> list[str]:
    """Return the public names, so that editors complete them."""
    return [*__all__, "__version__"]
