"""Which push next? Pushes in the order that a Gaussian process asks for.

From each surface, or from each virtual lab, a quarter of the kinds of push is kept for
tests. The engine is identified on the first few pushes, drawn at random; then pushes of
the pool are added, those that `choose_pushes` names or others at random, and the
process is fitted again.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np
from jaxtyping import Float, Int

from sainet.control.config import CollectConfig
from sainet.datasets.splits import split_rows
from sainet.datasets.store import Store, last_known
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
from sainet.learning.process import calibrated_fit
from sainet.learning.process_ends import Ends, ends_of
from sainet.models.correctors.process import RESIDUALS
from sainet.models.fitted_process import rates_at
from sainet.models.identity import ModelId
from sainet.models.process_card import ProcessSettings
from sainet.report.figures.curves import draw_data_efficiency
from sainet.runs.errors import BadStore
from sainet.studies import Scale
from sainet.studies.cross_validation import PHYSICS_IDENTIFIED
from sainet.studies.data_efficiency import of_pushes
from sainet.studies.lab_pushes import MUJOCO, Collect
from sainet.studies.recorded_models import surfaces_of
from sainet.studies.runner import Runner
from sainet.studies.steps import Apart, Given, Join, Step
from sainet.studies.study import MEASUREMENTS, RECORDED, Plan, Scope, Study

DRAWS = {"quick": 2, "paper": 20}
LABS = {"quick": (1, 60), "paper": (5, 500)}  # and the pushes collected in each
COUNTS = {"quick": (10, 20), "paper": tuple(range(25, 201, 25))}
SETTINGS = ProcessSettings(features="place")
TESTS = 0.25
RANDOM, CHOSEN = (ModelId(kind="gp", name=name) for name in ("at-random", "chosen"))
_STREAM = 0xAC71
Errors = Float[np.ndarray, "push body 2"]  # mm, degrees


class Draw(Apart[Measurements]):
    """Errors of both orders of some pushes, from one draw of tests and first ones."""

    is_kept = True

    pushes: Step[Store]
    number: int
    scale: Scale

    def run(self, runner: Runner) -> Measurements:
        """Return the errors, measured where that is unfinished."""
        path = runner.folder(self) / MEASUREMENTS
        if not path.is_file():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._measure(runner.result(self.pushes)).write(path)
        return read_measurements(path)

    def _measure(self, store: Store) -> Measurements:
        """Return the errors of processes that are fitted to ever more pushes."""
        counts = COUNTS[self.scale]
        pool, tests = split_rows(store.repeats(), TESTS, self.number)
        order = np.random.default_rng([_STREAM, self.number]).permutation(pool)
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
        fitted = calibrated_fit(ends.take(has), SETTINGS).fitted
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
    along, across, turned = np.moveaxis(off.reshape(len(off), -1, RESIDUALS), -1, 0)
    place = 1000 * np.hypot(along, across)
    return np.stack([place, np.rad2deg(np.abs(turned))], axis=-1)


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
        of_end = {"pos_mm": every[:, None, ..., 0], "rot_deg": every[:, None, ..., 1]}
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

    Errors are means over disks, and those of chosen pushes are interpolated between
    their counts. The interval is a bootstrap over draws; beyond the last count it ends
    there.
    """
    counts = [float(c.factors["training_pushes"]) for c in measured.header.conditions]
    place, draw = (measured.data[name].values for name in ("condition", "fold"))
    at_random, chosen = (
        np.array(
            [
                [
                    measured.values(metric, name)[
                        ..., (place == number) & (draw == one), :
                    ].mean()
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
    return Estimate(needed(np.arange(at_random.shape[1])), float(low), float(high))


def saving(measured: Measurements, metric: str) -> str:
    """Return `pushes_for_the_last` in words."""
    found = pushes_for_the_last(measured, metric)
    return f"{found.value:.0f} [{found.low:.0f}, {found.high:.0f}]"


def _recorded(scope: Scope) -> Plan:
    """Return the draws of each surface; they are the folds of the intervals."""
    store = scope.recorded_pushes()
    of_surfaces = [Given(store.take(rows)) for rows in surfaces_of(store).values()]
    draws = product(of_surfaces, range(DRAWS[scope.scale]))
    return Plan(Join(tuple(Draw(*each, scope.scale) for each in draws)))


def _collected(scope: Scope) -> Plan:
    """Return the draws in virtual labs, the same number in each."""
    return Plan(Join(tuple(_of_labs(scope.scale))))


def _of_labs(scale: Scale) -> Iterator[Draw]:
    labs, pushes = LABS[scale]
    for number in range(DRAWS[scale]):
        config = CollectConfig(robot="lab", lab=number % labs, pushes=pushes)
        yield Draw(Collect(config), number, scale)


RECORDED_STUDY = Study(
    question="How many recorded pushes are saved if the Gaussian process chooses them?",
    plan=_recorded,
    subject=RANDOM.slug,
    figure=draw_data_efficiency,
    needs=(RECORDED,),
)
LAB_STUDY = Study(
    question="Virtual lab: how many pushes are saved if the Gaussian process chooses "
    "them?",
    plan=_collected,
    subject=RANDOM.slug,
    figure=draw_data_efficiency,
    needs=(MUJOCO,),
)
