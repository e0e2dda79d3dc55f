"""Training of ensembles: networks of different seeds, and a calibration of regions."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.splits import split_rows
from sainet.datasets.store import Store, last_known
from sainet.engines.devices import is_one_gpu
from sainet.engines.simulator import InternalEngine
from sainet.learning.fit import complete
from sainet.learning.job import Job, begin, prepared
from sainet.learning.log import read_log
from sainet.learning.process import quantile, sizes_of
from sainet.learning.recipes import Recipe, SingleSteps
from sainet.learning.together import fit_together
from sainet.models.ensemble import Ensemble
from sainet.models.ensemble_card import ENSEMBLE, MEMBERS, EnsembleCard, Pair, member
from sainet.models.identity import ModelKind
from sainet.models.library import load_members
from sainet.runs.digests import digests_to_text
from sainet.runs.documents import write_document
from sainet.runs.errors import BadSetting, BadStore
from sainet.runs.folders import open_run
from sainet.scenes.geometry import rotate
from sainet.scenes.quantities import require_seed
from sainet.scenes.recording import CameraOffset

CALIBRATION = 0.2  # share of the pushes that no member is trained on
_FEWEST = 10  # of these pushes: the quantile of fewer is their maximum
_LEAST = 0.01  # smallest variance of a floor, as a fraction of that of the errors
_TINY = 1e-9  # m and rad
_BATCH = 256  # pushes at a time


def fit_ensemble(
    model: ModelKind,
    store: Store,
    recipe: Recipe,
    out: Path,
    *,
    members: int,
    engine: str | InternalEngine = "planar",
    on_step: Callable[[int, float | None], None] = lambda iteration, loss: None,
) -> float | None:
    """Train networks of consecutive seeds, then calibrate the regions of their mean.

    A fifth of the pushes, whole kinds at a time, is kept from all members. An
    identical call resumes.

    Args:
        model: `in` or `sain`.
        store: training data.
        recipe: of each member; the first has its seed.
        out: run folder, with a folder for each member.
        members: number of networks.
        engine: see `fit`.
        on_step: called with the iterations of all members so far, and the last loss.

    Returns:
        The mean of the last losses.

    Raises:
        BadSetting: too few or too many members, or networks of single steps.
        BadStore: the pushes do not suffice to calibrate.
        BadInput: see `fit`.
        RunConflict: the folder belongs to another run.
    """
    low, high = MEMBERS
    if not low <= members <= high:
        raise BadSetting("members", members, f"from {low} to {high}")
    if isinstance(recipe.horizon, SingleSteps):
        raise BadSetting("members", members, "left out for networks of single steps")
    require_seed(recipe.seed + members - 1)  # of the last member
    rest, held = divided(store, recipe.seed)
    training = store.take(np.sort(rest))
    settings = prepared(model, training, recipe, engine).settings()
    config = settings | {"data": store.content, "members": members}
    folder = open_run(out, config, finished_by=ENSEMBLE)

    def job(number: int) -> Job | None:
        own, place = recipe.changed(seed=recipe.seed + number), member(out, number)
        return begin(model, training, own, place, engine=engine)

    _train(job, members, on_step)
    logs = [read_log(member(out, number)) for number in range(members)]
    losses = [log[-1].loss for log in logs if log]
    loss = float(np.mean(losses)) if losses else None
    if not folder.is_finished:
        dynamics, cards = load_members(out, members)
        calibrated = _calibrate(dynamics, cards[0].camera, store.take(np.sort(held)))
        card = EnsembleCard(
            members=tuple(each.weights for each in cards),
            pushes=digests_to_text(store.push_hashes(), cards[0].pushes),
            final_loss=loss,
            **calibrated._asdict(),
        )
        write_document(out / ENSEMBLE, card)
    return loss


def divided(
    store: Store, seed: int
) -> tuple[Int[np.ndarray, " trained"], Int[np.ndarray, " held"]]:
    """Return the rows of pushes that train all members, and of those that calibrate.

    Raises:
        BadStore: the latter do not suffice.
    """
    rest, held = split_rows(store.repeats(), CALIBRATION, seed)
    if len(held) < _FEWEST:
        raise BadStore(
            f"{store.path}: {store.info.pushes} pushes, of which {len(held)} would "
            f"calibrate the ensemble; it needs at least {_FEWEST} of these."
        )
    return rest, held


def _train(
    job: Callable[[int], Job | None],
    members: int,
    on_step: Callable[[int, float | None], None],
) -> None:
    """Train all members that are not finished: on a GPU at once."""
    if is_one_gpu():
        jobs = [each for each in map(job, range(members)) if each is not None]
        fit_together(jobs, lambda done, loss: on_step(members * done, loss))
    for number in range(members):
        if (one := job(number)) is not None:
            before = number * one.recipe.optimiser.iterations
            complete(one, lambda done, loss, n=before: on_step(n + done, loss))


class _Calibrated(NamedTuple):
    """Fields of an `EnsembleCard`."""

    floor: tuple[Pair, ...]
    reach: tuple[Pair, ...]
    plain: tuple[Pair, ...]
    calibrated_on: int


def _calibrate(dynamics: Ensemble, camera: CameraOffset, held: Store) -> _Calibrated:
    """Calibrate members on pushes that none of them was trained on.

    Raises:
        BadStore: too few of their ends were observed.
    """
    parts = []
    for start in range(0, held.info.pushes, _BATCH):
        rows = range(start, min(start + _BATCH, held.info.pushes))
        arrays = held.take(rows).read(slice(None))
        batch = to_batch(arrays, held.info).seen_by(camera)
        parts.append(_missed_and_spread(dynamics, batch))
    missed, spread = (np.concatenate(each) for each in zip(*parts, strict=True))
    known = np.isfinite(missed).all(axis=(1, 2))
    missed, spread = missed[known], spread[known]
    if len(missed) < _FEWEST:
        raise BadStore(
            f"{held.path}: the ends of {len(missed)} pushes were observed that would "
            f"calibrate the ensemble; it needs at least {_FEWEST}."
        )
    variance, own = (np.mean(each**2, axis=0) for each in (missed, spread))
    lacking = np.maximum(variance - own, _LEAST * variance)
    floor = np.sqrt(np.stack([lacking[:, :2].mean(axis=1), lacking[:, 2]], axis=-1))
    floor = np.maximum(floor, _TINY)
    scaled = missed / np.sqrt(spread**2 + floor[:, [0, 0, 1]] ** 2)

    def listed(values: np.ndarray) -> tuple[Pair, ...]:
        return tuple((float(one), float(other)) for one, other in values)

    def within(off: np.ndarray) -> tuple[Pair, ...]:
        return listed(quantile(np.maximum(sizes_of(off), _TINY)))

    return _Calibrated(
        floor=listed(floor),
        reach=within(scaled),
        plain=within(missed),
        calibrated_on=len(missed),
    )


@eqx.filter_jit
def _ends(dynamics: Ensemble, batch: PushBatch) -> tuple[Array, Array, Array]:
    """Return mean poses, the deviations of final poses, and headings of pushes."""
    begun = dynamics.begin(batch.scene, batch.initial)
    pose = dynamics.advance(batch.scene, begun, batch.controls)[1].states.pose
    found = dynamics.spread(batch.scene, batch.initial, batch.controls)
    spread = jnp.concatenate([found.place, found.turn[..., None]], axis=-1)
    return pose, spread, found.heading


def _missed_and_spread(
    dynamics: Ensemble, batch: PushBatch
) -> tuple[Float[np.ndarray, "push body 3"], Float[np.ndarray, "push body 3"]]:
    """Return errors of final poses in the frame of the push, and deviations."""
    pose, spread, heading = _ends(dynamics, batch)
    seen = np.asarray(batch.pose_observed)
    off = last_known(np.asarray(batch.truth[..., :3] - pose, np.float64), seen)
    along = np.asarray(rotate(jnp.asarray(off[..., :2]), -heading[:, None]))
    turned = np.mod(off[..., 2:] + np.pi, 2 * np.pi) - np.pi
    return np.concatenate([along, turned], axis=-1), np.asarray(spread, np.float64)
