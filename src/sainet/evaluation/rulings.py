"""Rulings: the claims of a study together, corrected for how many there are.

The first claim of a study is its primary contrast, ruled on at p below 0.05. The others
share an error rate of 0.05: Holm (1979) multiplies the smallest p by their number, the
next by one less, and so on. A claim that holds by its intervals, but not after that, is
ruled not to hold.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from sainet.evaluation.claims import CHANCE, Claim, Comparison, Status
from sainet.evaluation.summary import Summary


@dataclass(frozen=True)
class Ruled:
    """A claim with the ruling on it.

    Attributes:
        claim: the claim.
        status: the ruling.
        p: corrected unless the claim is primary; None: it does not hold by its
            intervals, or its rule has no p.
        is_primary: whether it is the first claim of its study.
        comparisons: all that the ruling rests on.
        contradicting: those of them that contradict the claim.
    """

    claim: Claim
    status: Status
    p: float | None
    is_primary: bool
    comparisons: tuple[Comparison, ...] = ()
    contradicting: tuple[Comparison, ...] = ()


def rule_on(claims: Sequence[Claim], summary: Summary) -> tuple[Ruled, ...]:
    """Return the rulings on all claims of a study, in their order."""
    verdicts = [claim.rule(summary) for claim in claims]
    secondary = [v.p for v in verdicts[1:] if v.p is not None]
    # A claim that does not hold counts too: it was tested.
    tested = sum(v.is_test and v.status != "not testable here" for v in verdicts[1:])
    corrected = iter(holm(secondary, tested))
    found: list[Ruled] = []
    for number, (claim, verdict) in enumerate(zip(claims, verdicts, strict=True)):
        p, status = verdict.p, verdict.status
        if number and p is not None:
            p = next(corrected)
            status = status if p < CHANCE else "does not hold"
        rests_on = verdict.comparisons, verdict.contradicting
        found.append(Ruled(claim, status, p, not number, *rests_on))
    return tuple(found)


def holm(values: Sequence[float], tested: int) -> list[float]:
    """Return p after Holm's correction, in the same order.

    Args:
        values: p of some of the tests, those with the smallest p.
        tested: the number of all tests.
    """
    order = sorted(range(len(values)), key=values.__getitem__)
    found, highest = [0.0] * len(values), 0.0
    for rank, index in enumerate(order):
        highest = max(highest, min((tested - rank) * values[index], 1.0))
        found[index] = highest
    return found
