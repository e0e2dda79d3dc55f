"""Summary of a dataset of pushes: counts, ranges and doubtful recordings."""

from collections.abc import Iterator

import msgspec
import numpy as np
from jaxtyping import Bool, Float

from sainet.datasets.chains import continuations
from sainet.datasets.doubts import Doubt, find_doubts
from sainet.datasets.facts import Facts
from sainet.datasets.store import Store


class Range(msgspec.Struct, frozen=True, kw_only=True):
    """Least, median and largest of the finite values of a quantity."""

    name: str
    unit: str  # empty: a number
    low: float
    median: float
    high: float


class Inspection(msgspec.Struct, frozen=True, kw_only=True):
    """Summary of a dataset."""

    pushes: int
    disks: int
    setup: str
    engine: str  # that made the pushes, or "recorded"
    time_step: float  # s
    groups: dict[str, int]  # pushes by group
    observed: float  # share of the steps whose poses are known
    repeats: int  # pushes of which the dataset has another repeat
    chained: int  # pushes that start where another push ended
    ranges: tuple[Range, ...]
    doubts: tuple[Doubt, ...]


def inspect(store: Store, facts: Facts) -> Inspection:
    """Return the summary of a dataset.

    Args:
        store: the dataset.
        facts: of all its pushes, by `facts_of`.
    """
    info = store.info
    counts = np.bincount(facts.group, minlength=len(info.groups)).tolist()
    _, kind, same = np.unique(store.repeats(), return_inverse=True, return_counts=True)
    return Inspection(
        pushes=info.pushes,
        disks=info.bodies,
        setup=info.kind,
        engine=info.engine,
        time_step=info.time_step,
        groups=dict(zip(info.groups, counts, strict=False)),
        observed=float(facts.known_steps.sum() / facts.steps.sum()),
        repeats=int((same[kind] > 1).sum()),
        chained=int(starts_where_another_ends(facts).sum()),
        ranges=tuple(_ranges(facts)),
        doubts=tuple(find_doubts(store, facts)),
    )


def quantities_of(facts: Facts) -> dict[str, tuple[str, Float[np.ndarray, " _"]]]:
    """Return unit and values of each quantity that has a range, by its name."""
    way = (facts.end - facts.start)[..., :2]
    travel = np.linalg.norm(way, axis=-1)
    return {
        "steps": ("", facts.steps.astype(float)),
        "speed of the pusher": ("mm/s", 1e3 * facts.stroke / facts.duration),
        "stroke": ("mm", 1e3 * facts.stroke),
        "contact angle": ("deg", np.rad2deg(facts.contact_angle)),
        "push direction": ("deg", np.rad2deg(facts.direction)),
        **{
            f"travel of disk {body + 1}": ("mm", 1e3 * travel[:, body])
            for body in range(travel.shape[1])
        },
        "rotation": ("deg", np.rad2deg(facts.turned.max(axis=1))),
        "mass": ("kg", facts.mass.ravel()),
        "radius": ("mm", 1e3 * facts.radius.ravel()),
        "radius of the pusher": ("mm", 1e3 * facts.pusher_radius),
        "friction of table and disk": ("", facts.table_friction),
        "friction of two disks": ("", facts.disk_friction),
        "friction of pusher and disk": ("", facts.pusher_friction),
    }


def _ranges(facts: Facts) -> Iterator[Range]:
    for name, (unit, every) in quantities_of(facts).items():
        values = every[np.isfinite(every)]
        if len(values):
            low, median, high = map(float, np.quantile(values, [0, 0.5, 1]))
            yield Range(name=name, unit=unit, low=low, median=median, high=high)


def starts_where_another_ends(facts: Facts) -> Bool[np.ndarray, " push"]:
    """Return whether each push starts where another one ended."""
    ended, started = continuations(facts.start, facts.end)
    return np.isin(np.arange(len(facts.start)), started[started != ended])
