"""Registration of the environments with Gymnasium, which is not imported for it.

Gymnasium finds only environments that are registered already. The import of `sainet`
therefore registers them if Gymnasium is imported, and otherwise when it is: whatever
the order of imports, `gymnasium.make` finds them. It is the one effect of that import.
"""

import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

PUSH_DISKS = "sainet/PushDisks-v0"
_GYMNASIUM = "gymnasium"


def register() -> None:
    """Register the environments; a second call has no effect."""
    import gymnasium

    if PUSH_DISKS not in gymnasium.registry:
        gymnasium.register(
            PUSH_DISKS,
            entry_point="sainet.control.gym.environment:PushDisks",
            vector_entry_point="sainet.control.gym.vector:PushDisksVector",
        )


def register_when_imported() -> None:
    """Register the environments now, or when Gymnasium is imported."""
    if _GYMNASIUM in sys.modules:
        register()
    elif not any(isinstance(each, _Finder) for each in sys.meta_path):
        sys.meta_path.insert(0, _Finder())


class _Finder(MetaPathFinder):
    """Finds Gymnasium where Python does, and registers the environments after it."""

    def find_spec(
        self,
        name: str,
        path: Any,  # noqa: ANN401 - paths of namespaces are no sequences
        target: ModuleType | None = None,
    ) -> ModuleSpec | None:
        """Return where Gymnasium is; None for every other module."""
        spec = PathFinder.find_spec(name, path) if name == _GYMNASIUM else None
        if spec is None or spec.loader is None:
            return None
        execute = spec.loader.exec_module

        def execute_and_register(module: ModuleType) -> None:
            execute(module)
            register()

        spec.loader.exec_module = execute_and_register
        return spec
