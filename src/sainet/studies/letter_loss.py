"""Training by the letter of the paper, with another loss: in millimetres, or ours.

The paper states no unit of its loss. In metres its l2 of 1e-3 outweighs the errors; in
millimetres it has a millionth of that weight. With our loss, scaled by the data, the
inputs by the letter are then exchanged for ours one choice at a time.
"""

from collections.abc import Sequence
from functools import partial

from sainet.learning.recipes import PAPER
from sainet.studies import letter
from sainet.studies.letter import LETTER, TRAININGS, USUAL, Stage, World, sain_errs_less
from sainet.studies.paper_tables import PUBLISHED_DIRECT_FORCE_TWO_DISKS
from sainet.studies.study import Plan, Scope, Study

# Except for a factor, the loss in millimetres is that in metres with this l2.
MILLIMETRES = Stage(
    "letter, millimetres", LETTER.recipe.changed(l2=1e-9), "letter", "millimetres"
)
# Inputs by the letter, in the push frame, with relative motion, standardised, bounded.
OUR_LOSS = (
    *(
        Stage(f"{name}, scaled loss", PAPER.changed(features=name), name, "scaled-loss")
        for name in ("letter", "letter-push-frame", "letter-motion")
    ),
    Stage("unbounded inputs", PAPER.changed(features="unbounded"), "unbounded"),
    USUAL,
)


def _plan(stages: Sequence[Stage], scope: Scope) -> Plan:
    """Return the errors of IN and SAIN, trained on the pushes of the study `letter`."""
    world = World("letter", scope.scale, letter.REDUCED[scope.scale])
    return Plan(world.compare(stages, scope.seeds(TRAININGS)))


MILLIMETRES_STUDY = Study(
    question="By the letter, does SAIN err less than IN if the loss is in millimetres?",
    plan=partial(_plan, (MILLIMETRES,)),
    claims=sain_errs_less((MILLIMETRES,)),
    published=PUBLISHED_DIRECT_FORCE_TWO_DISKS,
)
OUR_LOSS_STUDY = Study(
    question="With our loss, which choices of inputs make the difference?",
    plan=partial(_plan, OUR_LOSS),
    claims=sain_errs_less(OUR_LOSS),
    published=PUBLISHED_DIRECT_FORCE_TWO_DISKS,
)
