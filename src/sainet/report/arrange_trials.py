"""Tables of control trials arranged from summaries."""

from collections.abc import Iterator, Mapping

from sainet.evaluation.conditions import PublishedValues
from sainet.evaluation.summary import Summary
from sainet.evaluation.trials import TrialRow, TrialTest
from sainet.report.palette import labels_of
from sainet.report.table import DASH, Cell, Column, Line, Table
from sainet.report.verdicts import verdicts_on

CHANCE = 0.05  # a smaller p is reported
_HEADINGS = (
    *("solved", "success (95 %)", "pushes (median)"),
    *("within 25 pushes", "within 4 mm", "decision (s)"),
)


def arrange_trials(summary: Summary) -> Table:
    """Return the table of control trials."""
    labels = labels_of([*summary.models, *(p.model for p in summary.published)])
    return Table(
        columns=tuple(Column(heading, heading) for heading in _HEADINGS),
        lines=tuple(_line(row, labels) for row in summary.trials),
        published=tuple(_published(each, labels) for each in summary.published),
        sentences=tuple(_sentences(summary, labels)),
        verdicts=verdicts_on(summary),
        samples="Trials",
        note="",
    )


def _line(row: TrialRow, labels: Mapping[str, str]) -> Line:
    low, high = row.interval
    texts = (
        f"{row.solved}/{row.trials}",
        f"{low:.0%}{DASH}{high:.0%}",
        DASH if row.median_pushes is None else f"{row.median_pushes:g}",
        f"{row.within_25_pushes:.0%}",
        f"{row.within_4_mm:.0%}",
        DASH if row.median_decision_s is None else f"{row.median_decision_s:.3f}",
    )
    cells = tuple(map(Cell, texts))
    return Line(row.condition, row.model, labels[row.model], cells)


def _published(each: PublishedValues, labels: Mapping[str, str]) -> Line:
    trials = each.trials or 0
    solved = f"{round((each.values['success'][0] or 0) * trials)}/{trials}"
    cells = (Cell(solved), *[Cell(DASH)] * (len(_HEADINGS) - 1))
    slug = each.model.slug
    return Line(each.condition, slug, f"{labels[slug]}, published", cells)


def _sentences(summary: Summary, labels: Mapping[str, str]) -> Iterator[str]:
    """Yield what noise ended early, and which goals only one model of two reached."""
    for row in summary.trials:
        if row.ended_early:
            yield (
                f"{row.condition}, {labels[row.model]}: {row.ended_early} of "
                f"{row.trials - row.solved} unsolved trials ended because the measured "
                "pose was within the tolerance"
            )
    for test in filter(_is_reported, summary.tests):
        yield (
            f"{test.condition}, {test.measure.replace('_', ' ')}: "
            f"only {labels[test.model]} {test.only_one}, "
            f"only {labels[test.against]} {test.only_other} "
            f"(exact McNemar p = {test.p:.2g})"
        )


def _is_reported(test: TrialTest) -> bool:
    """Report every difference in success, and of other measures what is not chance."""
    if test.measure == "solved":
        return bool(test.only_one or test.only_other)
    return test.p < CHANCE
