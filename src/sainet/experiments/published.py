"""Numbers that the paper publishes (Ajay et al., ICRA 2019), to stand beside ours."""

from typing import Any

# Position error (mm) and rotation error (deg) of each disk; trans (%).
ROBOT_TWO_DISKS = {
    "physics": {"trans": (2.52, 2.19), "pos": (6.27, 5.81), "rot": (0.85, 0.29)},
    "in": {"trans": (2.13, 1.59), "pos": (5.76, 3.84), "rot": (0.72, 0.28)},
    "sain": {"trans": (1.82, 1.50), "pos": (4.66, 3.47), "rot": (0.40, 0.21)},
}


def published_rows(
    table: dict[str, dict[str, tuple[float, ...]]],
) -> list[dict[str, Any]]:
    """Return a published table as rows like those of our own."""
    return [
        {
            "model": model,
            "body": body + 1,
            "group": None,
            "trans_percent": errors["trans"][body],
            "pos_mm": errors["pos"][body],
            "rot_deg": errors["rot"][body],
        }
        for model, errors in table.items()
        for body in range(len(errors["pos"]))
    ]
