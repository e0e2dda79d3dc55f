"""Which push next? Recorded pushes in the order that a Gaussian process asks for.

From each surface a quarter of the kinds of push is kept for tests. The engine is
identified on the first few pushes, drawn at random; then pushes of the pool are added,
those that `choose_pushes` names or others at random, and the process is fitted again.
"""

import numpy as np
from jaxtyping import Float, Int

from sainet.datasets.splits import last_known, split_rows
from sainet.datasets.store import Store
from sainet.evaluation.intervals import RESAMPLES, Estimate
from sainet.evaluation.joining import join
from sainet.evaluation.measurements import (
    Header,
    Measurements,
    measurements_of,
    read_measurements,
)
from sainet.evaluation.metrics import REFERENCE_DISTANCE, travel_mm
from sainet.identification.identify import identify
from sainet.learning.choosing import choose_pushes
from sainet.learning.process import fit_to
from sainet.learning.process_ends import Ends, ends_of
from sainet.models.identity import ModelId
from sainet.models.process_card import ProcessSettings, rates_at
from sainet.runs.errors import BadStore
from sainet.studies import Scale
from sainet.studies.cross_validation import PHYSICS_IDENTIFIED
from sainet.studies.data_efficiency import of_pushes
from sainet.studies.recorded_models import surfaces_of
from sainet.studies.runner import Runner
from sainet.studies.steps import Apart, Given, Join
from sainet.studies.study import MEASUREMENTS, RECORDED, Plan, Scope, Study

DRAWS = {"quick": 2, "paper": 20}
COUNTS = {"quick": (10, 20), "paper": tuple(range(25, 201, 25))}
SETTINGS = ProcessSettings(features="place")
TESTS = 0.25
RANDOM, CHOSEN = (ModelId(kind="gp", name=name) for name in ("at-random", "chosen"))
_STREAM = 0xAC71
Errors = Float[np.ndarray, "push 2"]  # mm, degrees


class Draw(Apart[Measurements]):
    """Errors of both orders on one surface, from one draw of tests and first pushes."""

    is_kept = True

    pushes: Given
    number: int
    scale: Scale

    def run(self, runner: Runner) -> Measurements:
        """Return the errors, measured where that is unfinished."""
        path = runner.folder(self) / MEASUREMENTS
        if not path.is_file():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._measure().write(path)
        return read_measurements(path)

    def _measure(self) -> Measurements:
        """Return the errors of processes that are fitted to ever more pushes."""
        counts, store = COUNTS[self.scale], self.pushes.store
        pool, tests = split_rows(store.repeats(), TESTS, self.number)
        rng = np.random.default_rng([_STREAM, self.number])
        order = rng.permutation(pool)
        engine = identify(store.take(order[: counts[0]])).engine
        ends = ends_of(store, engine, SETTINGS.features)
        if len(ends.travel) < store.info.pushes:
            raise BadStore(f"{store.path}: the end of a push was not observed.")
        found = [_missed(ends, tests, 0 * ends.rates[tests])]
        errors = {PHYSICS_IDENTIFIED: found * len(counts)}
        errors |= {
            model: _errors(ends, order, tests, counts, chosen=model == CHOSEN)
            for model in (RANDOM, CHOSEN)
        }
        return _measured(store, tests, errors, counts, self.number)


def _errors(
    ends: Ends,
    order: Int[np.ndarray, " pool"],
    tests: Int[np.ndarray, " test"],
    counts: tuple[int, ...],
    *,
    chosen: bool,
) -> list[Errors]:
    """Return the errors after ever more pushes."""
    known, found = order[: counts[0]], []
    for more in np.diff((*counts, counts[-1])):
        has = np.isin(np.arange(len(ends.travel)), known)
        fitted, _ = fit_to(ends.take(has), SETTINGS)
        found.append(_missed(ends, tests, rates_at(fitted, ends.inputs[tests])[0]))
        rest = order[~np.isin(order, known)]
        if chosen and more:
            rest = rest[choose_pushes(fitted, ends.inputs[rest], int(more))[0]]
        known = np.concatenate([known, rest[:more]])
    return found


def _missed(
    ends: Ends, rows: Int[np.ndarray, " some"], rates: Float[np.ndarray, "some output"]
) -> Errors:
    """Return the errors of final position (mm) and rotation (degrees)."""
    off = (ends.rates[rows] - rates) * ends.travel[rows, None]
    place = 1000 * np.hypot(off[:, 0], off[:, 1])
    return np.stack([place, np.rad2deg(np.abs(off[:, 2]))], axis=-1)


def _measured(
    store: Store,
    tests: Int[np.ndarray, " test"],
    errors: dict[ModelId, list[Errors]],
    counts: tuple[int, ...],
    number: int,
) -> Measurements:
    """Return the measurements of a draw, with a condition for each count."""
    arrays = store.read(slice(None), ("initial", "truth", "pose_observed"))
    final = last_known(arrays["truth"][..., :3], arrays["pose_observed"] > 0)
    travel = travel_mm(arrays["initial"][tests][..., :3], final[tests])
    header = Header(models=tuple(errors), reference_m=REFERENCE_DISTANCE["recorded"])
    parts = []
    for place, count in enumerate(counts):
        every = np.stack([found[place] for found in errors.values()])
        of_end = {"pos_mm": every[:, None, :, :1], "rot_deg": every[:, None, :, 1:]}
        both = of_end | {f"final_{name}": value for name, value in of_end.items()}
        part = measurements_of(
            both, travel, header, condition=np.zeros(len(tests)), row=tests
        )
        parts.append(part.in_condition(of_pushes(count)))
    whole = join(parts)
    folds = np.full(whole.data.sizes["sample"], number, np.int32)
    return Measurements(whole.data.assign_coords(fold=("sample", folds)), whole.header)


def pushes_for_the_last(measured: Measurements, metric: str) -> Estimate:
    """Return how many chosen pushes have the error of the most pushes at random.

    The error of chosen pushes is interpolated between their counts. The interval is a
    bootstrap over draws; beyond the last count it ends there.
    """
    counts = [float(c.factors["training_pushes"]) for c in measured.header.conditions]
    place, draw = (measured.data[name].values for name in ("condition", "fold"))
    at_random, chosen = (
        np.array(
            [
                [
                    measured.values(metric, name)
                    .reshape(-1)[(place == number) & (draw == one)]
                    .mean()
                    for one in np.unique(draw)
                ]
                for number in range(len(counts))
            ]
        )
        for name in (RANDOM.slug, CHOSEN.slug)
    )

    def needed(draws: Int[np.ndarray, " draw"]) -> float:
        target = at_random[-1, draws].mean()
        falling = np.minimum.accumulate(chosen[:, draws].mean(axis=1))
        return float(np.interp(-target, -falling, counts))

    drawn = np.random.default_rng(_STREAM).integers(
        at_random.shape[1], size=(RESAMPLES, at_random.shape[1])
    )
    low, high = np.percentile([needed(each) for each in drawn], (2.5, 97.5))
    whole = needed(np.arange(at_random.shape[1]))
    return Estimate(whole, float(low), float(high))


def saving(measured: Measurements, metric: str) -> str:
    """Return `pushes_for_the_last` in words."""
    found = pushes_for_the_last(measured, metric)
    return f"{found.value:.0f} [{found.low:.0f}, {found.high:.0f}]"


def _plan(scope: Scope) -> Plan:
    """Return the draws of each surface; they are the folds of the intervals."""
    store = scope.recorded_pushes()
    return Plan(
        Join(
            tuple(
                Draw(Given(store.take(rows)), number, scope.scale)
                for rows in surfaces_of(store).values()
                for number in range(DRAWS[scope.scale])
            )
        )
    )


STUDY = Study(
    question="How many recorded pushes does a Gaussian process save that chooses them?",
    plan=_plan,
    subject=RANDOM.slug,
    needs=(RECORDED,),
)
