"""Training by the letter of the paper, with the loss in millimetres.

The paper states no unit of its loss. In metres its l2 of 1e-3 outweighs the errors; in
millimetres it has a millionth of that weight.
"""

from sainet.studies import letter
from sainet.studies.letter import LETTER, TRAININGS, Stage, World, sain_errs_less
from sainet.studies.paper_tables import PUBLISHED_DIRECT_FORCE_TWO_DISKS
from sainet.studies.study import Plan, Scope, Study

# Except for a factor, the loss in millimetres is that in metres with this l2.
MILLIMETRES = Stage(
    "letter, millimetres", LETTER.recipe.changed(l2=1e-9), "letter", "millimetres"
)


def _plan(scope: Scope) -> Plan:
    """Return the errors of IN and SAIN, trained on the pushes of the study `letter`."""
    world = World("letter", scope.scale, letter.REDUCED[scope.scale])
    return Plan(world.compare((MILLIMETRES,), scope.seeds(TRAININGS)))


STUDY = Study(
    question="By the letter, does SAIN err less than IN if the loss is in millimetres?",
    plan=_plan,
    claims=sain_errs_less((MILLIMETRES,)),
    published=PUBLISHED_DIRECT_FORCE_TWO_DISKS,
)
