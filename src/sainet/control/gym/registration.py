"""Registration of the environments with Gymnasium, which is not imported for it."""

import sys

PUSH_DISKS = "sainet/PushDisks-v0"


def register_if_imported() -> None:
    """Register the environments if Gymnasium is imported; again has no effect.

    Gymnasium finds only environments that are registered already, and has no plugins.
    """
    gymnasium = sys.modules.get("gymnasium")
    # While Gymnasium is being imported, it has no registry yet.
    if PUSH_DISKS not in getattr(gymnasium, "registry", {PUSH_DISKS: None}):
        gymnasium.register(  # pyright: ignore[reportOptionalMemberAccess]
            PUSH_DISKS,
            entry_point="sainet.control.gym.environment:PushDisks",
            vector_entry_point="sainet.control.gym.vector:PushDisksVector",
        )
