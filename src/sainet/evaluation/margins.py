"""Claims that a model errs at most a little more than another."""

from collections.abc import Sequence

from sainet.evaluation.claims import Rule, Verdict, compared, sign
from sainet.evaluation.summary import Summary


def errs_at_most_more(
    model: str,
    against: str,
    margin: float,
    *,
    condition: str = "",
    metrics: Sequence[str] = ("pos_mm", "rot_deg"),
    less: float = 0.0,
) -> Rule:
    """Return the rule that no upper 95 % bound of a paired difference is large.

    Args:
        model: slug of the model.
        against: slug of the other model.
        margin: largest bound, as a fraction of the error of the other model.
        condition: label of the condition.
        metrics: errors that count, each on each disk.
        less: fraction of these errors in which the model must be clearly better.
    """

    def rule(summary: Summary) -> Verdict:
        pairs = compared(summary, model, against, condition)
        found = tuple(each for each in pairs if each.metric in metrics)
        if not found or any(each.difference.high is None for each in found):
            return Verdict("not testable here", found, is_test=False)
        errors = {each: summary.errors(against, each, condition) for each in metrics}
        wrong = tuple(
            each
            for each in found
            if (each.difference.high or 0) > margin * errors[each.metric][each.body - 1]
        )
        better = sum(sign(each) < 0 for each in found)
        holds = not wrong and better >= less * len(found)
        status = "holds" if holds else "does not hold"
        return Verdict(status, found, wrong, is_test=False)

    return rule
