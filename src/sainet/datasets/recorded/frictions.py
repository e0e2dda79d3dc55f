"""The frictions that an engine is told of recorded pushes."""

from sainet.runs.errors import BadInput

CONTACT_FRICTION = 0.25
TABLE_FRICTION = 0.15  # the paper's; a quasi-static path hardly depends on it


def check_frictions(contact_friction: float, table_friction: float) -> None:
    """Check what the user says of friction.

    Raises:
        BadInput: one is negative or no number.
    """
    # No command has an option for the second: whoever calls from Python set it.
    options = {"--contact-friction": contact_friction, "table_friction": table_friction}
    for name, value in options.items():
        if not 0 <= value < float("inf"):
            raise BadInput(f"{name} is {value}; it must be zero or positive.")
