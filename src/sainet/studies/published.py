"""Numbers that the paper publishes (Ajay et al., ICRA 2019), to stand beside ours."""

from sainet.evaluation.measurements import PublishedValues
from sainet.models.identity import ModelId
from sainet.studies.paper_setup import IN, SAIN, physics

_PHYSICS = physics()[0].id


def _errors(
    model: ModelId,
    trans: tuple[float, ...],  # %
    pos: tuple[float, ...],  # mm
    rot: tuple[float, ...],  # deg
) -> PublishedValues:
    """Return the published errors of one model, for each disk."""
    return PublishedValues(
        condition="",
        model=model,
        values={"trans_percent": trans, "pos_mm": pos, "rot_deg": rot},
    )


def _trials(condition: str, model: ModelId, success: float) -> PublishedValues:
    """Return the published share of solved trials of one model."""
    return PublishedValues(
        condition=condition,
        model=model,
        values={"success": (success,)},
        trials=25,
    )


PUBLISHED_DIRECT_FORCE_TWO_DISKS = (
    _errors(_PHYSICS, (2.82, 2.31), (6.57, 6.05), (0.91, 0.45)),
    _errors(IN, (2.09, 1.47), (5.61, 3.79), (0.68, 0.26)),
    _errors(SAIN, (1.62, 1.38), (4.38, 3.34), (0.38, 0.20)),
)
PUBLISHED_DIRECT_FORCE_THREE_DISKS = (
    _errors(_PHYSICS, (2.79, 2.34, 2.38), (6.53, 6.11, 6.21), (0.89, 0.48, 0.49)),
    _errors(IN, (2.12, 1.63, 1.67), (5.68, 4.41, 4.52), (0.70, 0.34, 0.38)),
    _errors(SAIN, (1.68, 1.52, 1.61), (4.54, 3.97, 4.34), (0.41, 0.25, 0.32)),
)
PUBLISHED_ROBOT_TWO_DISKS = (
    _errors(_PHYSICS, (2.52, 2.19), (6.27, 5.81), (0.85, 0.29)),
    _errors(IN, (2.13, 1.59), (5.76, 3.84), (0.72, 0.28)),
    _errors(SAIN, (1.82, 1.50), (4.66, 3.47), (0.40, 0.21)),
)

# Bullet's world, the paper's search.
PUBLISHED_SIMULATED_CONTROL = (
    _trials("easy, greedy", IN, 1.00),
    _trials("hard, greedy", IN, 0.88),
    _trials("easy, greedy", SAIN, 1.00),
    _trials("hard, greedy", SAIN, 1.00),
)
