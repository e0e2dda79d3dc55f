"""Numbers that the paper publishes (Ajay et al., ICRA 2019), to stand beside ours."""

from sainet.evaluation.conditions import PublishedValues
from sainet.models.identity import identity_named


def _errors(
    model: str,
    trans: tuple[float, ...],  # %
    pos: tuple[float, ...],  # mm
    rot: tuple[float, ...],  # deg
) -> PublishedValues:
    """Return the published errors of one model, for each disk."""
    return PublishedValues(
        condition="",
        model=identity_named(model),
        values={"trans_percent": trans, "pos_mm": pos, "rot_deg": rot},
    )


def _trials(condition: str, model: str, success: float) -> PublishedValues:
    """Return the published share of solved trials of one model."""
    return PublishedValues(
        condition=condition,
        model=identity_named(model),
        values={"success": (success,)},
        trials=25,
    )


DIRECT_FORCE_TWO_DISKS = (
    _errors("physics", (2.82, 2.31), (6.57, 6.05), (0.91, 0.45)),
    _errors("in", (2.09, 1.47), (5.61, 3.79), (0.68, 0.26)),
    _errors("sain", (1.62, 1.38), (4.38, 3.34), (0.38, 0.20)),
)
DIRECT_FORCE_THREE_DISKS = (
    _errors("physics", (2.79, 2.34, 2.38), (6.53, 6.11, 6.21), (0.89, 0.48, 0.49)),
    _errors("in", (2.12, 1.63, 1.67), (5.68, 4.41, 4.52), (0.70, 0.34, 0.38)),
    _errors("sain", (1.68, 1.52, 1.61), (4.54, 3.97, 4.34), (0.41, 0.25, 0.32)),
)
ROBOT_TWO_DISKS = (
    _errors("physics", (2.52, 2.19), (6.27, 5.81), (0.85, 0.29)),
    _errors("in", (2.13, 1.59), (5.76, 3.84), (0.72, 0.28)),
    _errors("sain", (1.82, 1.50), (4.66, 3.47), (0.40, 0.21)),
)

# Bullet's world, the paper's search.
SIMULATED_CONTROL = (
    _trials("easy, greedy", "in", 1.00),
    _trials("hard, greedy", "in", 0.88),
    _trials("easy, greedy", "sain", 1.00),
    _trials("hard, greedy", "sain", 1.00),
)
