"""The frictions that an engine is told of recorded pushes."""

from sainet.scenes.quantities import FRICTION

CONTACT_FRICTION = 0.25
TABLE_FRICTION = 0.15  # the paper's; a quasi-static path hardly depends on it


def check_frictions(contact_friction: float, table_friction: float) -> None:
    """Check the frictions of recorded pushes.

    Raises:
        BadSetting: one is out of range.
    """
    frictions = {"contact_friction": contact_friction, "table_friction": table_friction}
    for name, value in frictions.items():
        FRICTION.require(name, value)
