"""Success of control trials, with its interval, and paired tests."""

from collections.abc import Iterator
from itertools import combinations

import msgspec
import numpy as np
from jaxtyping import Bool
from scipy.special import stdtr

from sainet.evaluation.intervals import Folds, Sample, folds_of, known, wilson
from sainet.evaluation.measurements import Condition, Measurements

# What an episode reaches or does not.
MEASURES = ("solved", "within_4_mm", "within_25_pushes")
_NEAR_MM = 4.0
_FEW_PUSHES = 25


class TrialRow(msgspec.Struct, frozen=True, kw_only=True):
    """The trials of one model in one condition."""

    condition: str
    model: str  # slug
    trials: int
    solved: int
    success: float
    interval: tuple[float, float]  # 95 %: Wilson's, or over labs
    median_pushes: float | None  # of solved trials
    median_decision_s: float | None
    within_4_mm: float
    within_25_pushes: float
    median_final_mm: float | None
    ended_early: int  # the measured pose was within the tolerance, the true one not

    def to_dict(self) -> dict[str, object]:
        """Return everything but condition and model as JSON values."""
        every: dict[str, object] = msgspec.to_builtins(self)
        return {k: v for k, v in every.items() if k not in ("condition", "model")}


class TrialTest(msgspec.Struct, frozen=True, kw_only=True):
    """A paired test of two models on the same goals: McNemar's, exact, or over labs.

    Trials of one lab share a network and hidden properties: they are not independent.
    """

    condition: str
    measure: str  # one of `MEASURES`
    model: str
    against: str
    only_one: int  # trials in which `model` reached it and `against` did not
    only_other: int
    p: float


def trial_rows(measured: Measurements) -> tuple[TrialRow, ...]:
    """Return success with its interval, medians and shares, condition by condition."""
    return tuple(
        _row(measured, slug, condition)
        for condition in measured.header.conditions
        for slug in measured.slugs
        if was_tried(measured, slug, condition)
    )


def compare_trials(measured: Measurements) -> tuple[TrialTest, ...]:
    """Return the tests of every pair of models, for each measure."""
    return tuple(
        test
        for condition in measured.header.conditions
        for test in _tests(measured, condition)
    )


def was_tried(measured: Measurements, slug: str, condition: Condition) -> bool:
    """Return whether a model has trials in a condition."""
    part = measured.samples_of(condition)
    return bool(np.isfinite(measured.values("solved", slug)[part]).any())


def _row(measured: Measurements, slug: str, condition: Condition) -> TrialRow:
    part = measured.samples_of(condition)

    def column(name: str) -> np.ndarray:
        return measured.values(name, slug)[part]

    solved, near, soon = (
        reached(measured, slug, condition, measure) for measure in MEASURES
    )
    seconds = column("decision_s")
    seconds = seconds[np.isfinite(seconds)]
    labs = _labs(measured, condition)
    if labs is None:
        low, high = wilson(solved.mean(), len(solved))
    else:
        _, (low,), (high,) = Sample(solved[:, None].astype(float), labs).share
    pushes = column("pushes")[solved]
    return TrialRow(
        condition=condition.label,
        model=slug,
        trials=len(solved),
        solved=int(solved.sum()),
        success=float(solved.mean()),
        interval=(float(low), float(high)),
        median_pushes=float(np.median(pushes)) if solved.any() else None,
        median_decision_s=float(np.median(seconds)) if len(seconds) else None,
        within_4_mm=float(near.mean()),
        within_25_pushes=float(soon.mean()),
        median_final_mm=known(float(np.median(column("final_mm")))),
        ended_early=int(((column("ended") > 0) & ~solved).sum()),
    )


def reached(
    measured: Measurements, slug: str, condition: Condition, measure: str
) -> Bool[np.ndarray, " trial"]:
    """Return which trials reached one of `MEASURES`."""
    part = measured.samples_of(condition)
    solved = measured.values("solved", slug)[part] > 0
    if measure == "within_4_mm":
        return measured.values("final_mm", slug)[part] <= _NEAR_MM
    if measure == "within_25_pushes":
        return solved & (measured.values("pushes", slug)[part] <= _FEW_PUSHES)
    return solved


def _labs(measured: Measurements, condition: Condition) -> Folds | None:
    """Return the labs of several trials; None if they are not of labs."""
    part = measured.data["fold"].values[measured.samples_of(condition)]
    has_labs = measured.header.has_labs and len(part) > 1
    return folds_of(part, are_labs=True) if has_labs else None


def _tests(measured: Measurements, condition: Condition) -> Iterator[TrialTest]:
    labs = _labs(measured, condition)
    tried = [s for s in measured.slugs if was_tried(measured, s, condition)]
    for measure in MEASURES:
        found = {s: reached(measured, s, condition, measure) for s in tried}
        for against, model in combinations(tried, 2):
            mine, theirs = found[model], found[against]
            yield TrialTest(
                condition=condition.label,
                measure=measure,
                model=model,
                against=against,
                only_one=int((mine & ~theirs).sum()),
                only_other=int((theirs & ~mine).sum()),
                p=_chance(mine, theirs, labs),
            )


def _chance(mine: np.ndarray, theirs: np.ndarray, labs: Folds | None) -> float:
    """Return p, two-sided, that trials reach as much with either model."""
    if labs:
        one, other = (Sample(x[:, None].astype(float), labs) for x in (mine, theirs))
        return _agreeing(mine, theirs, labs) or float(one.chance(other)[0])
    from scipy.stats import binomtest  # slow to import

    unlike = int((mine != theirs).sum())
    return float(binomtest(int((mine & ~theirs).sum()), unlike).pvalue) if unlike else 1


def _agreeing(mine: np.ndarray, theirs: np.ndarray, labs: Folds) -> float:
    """Return p of labs that all favour one model; 0 if they do not.

    No resample of such labs favours the other model, however few they are. So the mean
    of their differences is tested by Student's t, as if one trial less had differed.
    """
    owner, more = np.array(labs.of_push), mine.astype(float) - theirs
    found = np.array([more[owner == lab].mean() for lab in np.unique(owner)])
    if abs(np.sign(found).sum()) < len(found):
        return 0.0
    if len(found) == 1:
        return 1.0
    trial = 1 / len(more)
    error = max(float(found.std(ddof=1)) / len(found) ** 0.5, trial)
    return float(2 * stdtr(len(found) - 1, (trial - abs(found.mean())) / error))
