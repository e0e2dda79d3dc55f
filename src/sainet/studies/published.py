"""Numbers that the paper publishes (Ajay et al., ICRA 2019), to stand beside ours."""

from collections.abc import Mapping, Sequence
from typing import Any

# Position error (mm) and rotation error (deg) of each disk; trans (%).
DIRECT_FORCE_TWO_DISKS = {
    "physics": {"trans": (2.82, 2.31), "pos": (6.57, 6.05), "rot": (0.91, 0.45)},
    "in": {"trans": (2.09, 1.47), "pos": (5.61, 3.79), "rot": (0.68, 0.26)},
    "sain": {"trans": (1.62, 1.38), "pos": (4.38, 3.34), "rot": (0.38, 0.20)},
}
DIRECT_FORCE_THREE_DISKS = {
    "physics": {
        "trans": (2.79, 2.34, 2.38),
        "pos": (6.53, 6.11, 6.21),
        "rot": (0.89, 0.48, 0.49),
    },
    "in": {
        "trans": (2.12, 1.63, 1.67),
        "pos": (5.68, 4.41, 4.52),
        "rot": (0.70, 0.34, 0.38),
    },
    "sain": {
        "trans": (1.68, 1.52, 1.61),
        "pos": (4.54, 3.97, 4.34),
        "rot": (0.41, 0.25, 0.32),
    },
}
ROBOT_TWO_DISKS = {
    "physics": {"trans": (2.52, 2.19), "pos": (6.27, 5.81), "rot": (0.85, 0.29)},
    "in": {"trans": (2.13, 1.59), "pos": (5.76, 3.84), "rot": (0.72, 0.28)},
    "sain": {"trans": (1.82, 1.50), "pos": (4.66, 3.47), "rot": (0.40, 0.21)},
}

# Shares of 25 trials each, Bullet's world, the paper's search.
SIMULATED_CONTROL = (
    {"group": "easy, greedy", "model": "in", "trials": 25, "success": 1.00},
    {"group": "hard, greedy", "model": "in", "trials": 25, "success": 0.88},
    {"group": "easy, greedy", "model": "sain", "trials": 25, "success": 1.00},
    {"group": "hard, greedy", "model": "sain", "trials": 25, "success": 1.00},
)


def published_rows(
    table: Mapping[str, Mapping[str, Sequence[float]]],
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
