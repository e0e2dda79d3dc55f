"""Whether the regions of models hold the ends of pushes as often as they should.

Regions of position are ellipses, those of rotation intervals. Their quality is half
the interval score of Gneiting and Raftery (2007): the half width of a region, plus ten
times the distance from it of an end outside. Of an ellipse, the half width is the
radius of the circle of its area, and distances are scaled likewise. A region of one
size for all pushes, calibrated on the same pushes, stands beside them.
"""

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np
from jaxtyping import Float

from sainet.evaluation.intervals import Estimate, Sample, estimate, folds_of
from sainet.evaluation.measurements import Condition, Measurements
from sainet.models.correctors import CONFIDENCE, Region, interval_score
from sainet.scenes.geometry import wrap_angle

KINDS = ("pos", "rot")
UNITS = {"pos": "mm", "rot": "deg"}
# Names of further measurements of each push, by kind.
INSIDE, SIZE, SCORE, PLAIN = "inside_{}", "size_{}", "score_{}", "plain_score_{}"
MEASURED = tuple(n.format(kind) for n in (INSIDE, SIZE, SCORE, PLAIN) for kind in KINDS)


class Coverage(msgspec.Struct, frozen=True, kw_only=True):
    """How well the regions of one model hold the ends of one body's pushes."""

    condition: str
    model: str  # slug
    body: int  # 1-based
    kind: str  # pos or rot
    count: int  # pushes
    inside: Estimate  # %, share of the ends in their region
    size: Estimate  # mean half width, mm or degrees
    score: Estimate  # mean interval score, halved, mm or degrees
    over_plain: Estimate  # score over that of regions of one size


def measured(
    region: Region,
    predicted: Float[np.ndarray, "push body 3"],
    true: Float[np.ndarray, "push body 3"],
) -> dict[str, Float[np.ndarray, "push body"]]:
    """Return size and score of the region of each push, and whether it holds the end.

    Args:
        region: about the predicted end.
        predicted: final pose (m, m, rad).
        true: final pose that was observed; NaN: none was, and nothing is known.
    """
    off = true - predicted
    turn = wrap_angle(off[..., 2])
    axes = np.asarray(region.axes, np.float64)
    heading = np.asarray(region.heading, np.float64)[:, None]
    cosine, sine = np.cos(heading), np.sin(heading)
    along = cosine * off[..., 0] + sine * off[..., 1]
    across = cosine * off[..., 1] - sine * off[..., 0]
    plain = np.asarray(region.plain, np.float64)
    place = np.hypot(along / axes[..., 0], across / axes[..., 1])  # 1 on the ellipse
    width = {"pos": 1000 * np.sqrt(axes.prod(axis=-1))}
    width["rot"] = np.rad2deg(np.asarray(region.turn, np.float64))
    error = {"pos": place * width["pos"], "rot": np.rad2deg(np.abs(turn))}
    same = {"pos": 1000 * plain[..., 0], "rot": np.rad2deg(plain[..., 1])}
    whole = {"pos": 1000 * np.hypot(along, across), "rot": error["rot"]}
    found: dict[str, np.ndarray] = {}
    for kind in KINDS:
        found[INSIDE.format(kind)] = np.heaviside(width[kind] - error[kind], 1.0)
        found[SIZE.format(kind)] = width[kind]
        found[SCORE.format(kind)] = interval_score(width[kind], error[kind])
        found[PLAIN.format(kind)] = interval_score(same[kind], whole[kind])
    return found


def coverage_of(measured: Measurements) -> list[Coverage]:
    """Return the coverage of every model with regions, condition by condition."""
    if MEASURED[0] not in measured.data:
        return []
    return [
        each
        for condition in measured.header.conditions
        for slug in measured.slugs
        for kind in KINDS
        for each in _coverage(measured, condition, slug, kind)
    ]


HEADINGS = (
    *("pushes", "model", "of", "disk", "n", "inside (%)", "half width"),
    *("interval score", "score over regions of one size"),
)


def rows_of(measured: Measurements, conditions: Sequence[str]) -> list[list[str]]:
    """Return the coverage in some conditions, in their order, below `HEADINGS`."""
    found = coverage_of(measured)
    models = {model.slug: model.label for model in measured.header.models}
    chosen = [e for label in conditions for e in found if e.condition == label]
    return [_cells(each, models[each.model]) for each in chosen]


def to_json(found: Sequence[Coverage]) -> dict[str, object]:
    """Return coverage as a part of a JSON object; nothing where there is none."""
    return {"coverage": msgspec.to_builtins(found)} if found else {}


_UNKNOWN = "–"  # noqa: RUF001


def _cells(found: Coverage, label: str) -> list[str]:
    unit = "°" if found.kind == "rot" else " mm"
    ends = [found.inside, found.size, found.score, found.over_plain]
    digits = [1, 2, 2, 2]
    numbers = [
        _UNKNOWN
        if each.value is None or each.low is None
        else f"{each.value:.{n}f} [{each.low:.{n}f}, "
        f"{_UNKNOWN if each.high is None else format(each.high, f'.{n}f')}]"
        for each, n in zip(ends, digits, strict=True)
    ]
    numbers[1], numbers[2] = numbers[1] + unit, numbers[2] + unit
    what = "position" if found.kind == "pos" else "rotation"
    return [found.condition, label, what, str(found.body), str(found.count), *numbers]


def in_words(found: Sequence[Coverage], labels: Mapping[str, str]) -> list[str]:
    """Return a sentence for each coverage, given the labels of models by slug."""
    return [_sentence(each, labels[each.model]) for each in found]


def _sentence(found: Coverage, label: str) -> str:
    where = f"{found.condition}: " if found.condition else ""
    what = "final positions" if found.kind == "pos" else "final rotations"
    inside, size, over = found.inside, found.size, found.over_plain
    numbers = (*msgspec.structs.astuple(inside), size.value)
    if None in numbers or over.value is None:
        return f"{where}{label}: too few pushes to judge its 90 % regions"
    is_unlike = (inside.high or 0.0) < 100 * CONFIDENCE
    verdict = "; fewer than they promise: do not trust them on such pushes" * is_unlike
    return (
        f"{where}{label}: its 90 % regions hold {inside.value:.0f} % "
        f"[{inside.low:.0f}, {inside.high:.0f}] of the {what} of disk {found.body}; "
        f"half width {size.value:.2f} {UNITS[found.kind]}; interval score "
        f"{over.value:.2f} of that of regions of one size{verdict}"
    )


def _coverage(
    measured: Measurements, condition: Condition, slug: str, kind: str
) -> Sequence[Coverage]:
    part = measured.samples_of(condition)
    folds = folds_of(
        measured.data["fold"].values[part], are_labs=measured.header.has_labs
    )

    def sample(name: str) -> Sample:
        return Sample(measured.values(name.format(kind), slug)[..., part, :], folds)

    inside, size, score, plain = map(sample, (INSIDE, SIZE, SCORE, PLAIN))
    if not np.isfinite(inside.values).all() or not part.any():
        return []
    share, low, high = inside.share
    percentage = 100 * share, 100 * low, 100 * high
    intervals = (percentage, size.interval, score.interval, score.over(plain))
    return [
        Coverage(
            condition=condition.label,
            model=slug,
            body=body + 1,
            kind=kind,
            count=int(part.sum()),
            **{
                name: estimate(interval, body)
                for name, interval in zip(
                    ("inside", "size", "score", "over_plain"), intervals, strict=True
                )
            },
        )
        for body in range(inside.values.shape[-1])
    ]
