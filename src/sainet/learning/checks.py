"""Checks that a training job can run, before its folder is made."""

from collections.abc import Iterator, Sequence

import numpy as np

from sainet.datasets.store import Store
from sainet.engines.simulator import SIMULATORS, PlanarSpec, SimulatorSpec
from sainet.learning.recipes import FROM_ENGINE
from sainet.learning.task import Existing, Task
from sainet.models.card import CARD
from sainet.models.identity import NETWORKS
from sainet.runs.errors import BadCheckpoint, BadInput, BadStore, require_one_of
from sainet.scenes.quantities import MASS, RADIUS

_ALIKE = 1.5  # times as large: networks still correct what the engine assumes wrongly


def check_apart(stores: Sequence[Store]) -> None:
    """Raise `BadStore` if a push is in two datasets."""
    for index, store in enumerate(stores):
        for other in stores[:index]:
            if twice := len(np.intersect1d(store.push_hashes(), other.push_hashes())):
                raise BadStore(
                    f"{store.path}: {twice} of its pushes are in {other.path}, too; "
                    "give each push once."
                )


def check_task(task: Task) -> None:
    """Check that the data suffice and that training can start from its network.

    Raises:
        BadStore: the data lack inputs of the network.
        BadInput: the recipe does not fit the model or the data.
        BadCheckpoint: training cannot start from that network.
    """
    path = task.store.path
    require_one_of("model", task.model, NETWORKS)
    _check_simulator(task)
    if task.is_additive and task.inner is None:
        raise BadInput(
            f"`start` is {FROM_ENGINE}; {task.model} has no internal engine: train "
            "sain, or give `start` a network."
        )
    share = task.recipe.stopping.validation_share
    if share and task.validation is None:
        raise BadInput(
            f"`validation_share` is {share}; {path} has no two pushes that are not "
            "repeats of each other."
        )
    _check_observed(task)
    if task.existing:
        _check_existing(task, task.existing)
    if task.has_single_steps:
        _check_single_steps(task)
    if task.recipe.features == "contact":
        _check_contacts(task)


def _check_observed(task: Task) -> None:
    """Raise `BadStore` if the first steps, on which networks train, are unknown.

    Pushes of a length that was never observed there would count nothing.
    """
    horizon = task.recipe.horizon
    steps = task.short_steps if horizon.short_iterations else horizon.steps
    remedy = ", and without `short_iterations`" * (horizon.short_iterations > 0)
    seen, lengths = _seen(task.training)
    chosen = seen.any(axis=1) | (not seen.any())
    for length in np.unique(lengths[chosen]):
        if not seen[lengths == length, :steps].any():
            raise BadStore(
                f"{task.training.path}: no push of {length} steps is observed in its "
                f"first {steps}; train on more `steps`{remedy}."
            )
    if task.validation and not _seen(task.validation)[0][:, : horizon.steps].any():
        raise BadStore(
            f"{task.validation.path}: no validation push is observed in its first "
            f"{horizon.steps} steps; train on more `steps`."
        )


def _seen(store: Store) -> tuple[np.ndarray, np.ndarray]:
    """Return which steps are observed, [push, time], and the steps of each push."""
    known = store.read(slice(None), ("pose_observed", "rate_observed", "steps"))
    seen = (known["pose_observed"] > 0) | (known["rate_observed"] > 0)
    return seen, known["steps"]


def other_disks(task: Task) -> Iterator[str]:
    """Yield a warning for each property that the internal engine assumes wrongly."""
    if task.inner is None:
        return
    assumed = task.inner.simulator.assumptions
    given = task.store.read(slice(None), ("mass", "radius"))
    for each, listed in ((MASS, assumed.mass), (RADIUS, assumed.radius)):
        if listed is None:
            continue
        known = np.mean(given[each.name], axis=0)[: len(listed)]
        ratio = known / listed[: len(known)]
        if max(ratio.max(), 1 / ratio.min()) > _ALIKE:
            here, there = (", ".join(f"{x:.3g}" for x in xs) for xs in (known, listed))
            yield (
                f"{task.store.path}: {each.name} is {here} {each.unit}, but the "
                f"internal engine assumes {there} {each.unit}; take planar-true, or "
                "the folder of an identified engine."
            )


def _check_simulator(task: Task) -> None:
    info, path, simulator = task.store.info, task.store.path, task.assumed.simulator
    if simulator.slug in info.assumed_engines:
        return
    is_robot = info.kind == "robot"
    if simulator.slug in SIMULATORS and not (is_robot and simulator.engine == "planar"):
        raise BadStore(
            f"{path}: no simulator prediction of {simulator.slug}; use "
            f"{' or '.join(info.assumed_engines)}, or the folder of identified "
            "parameters."
        )
    if not is_robot:
        raise BadStore(
            f"{path}: kind is {info.kind!r}; identified engines and engines of your "
            "own predict pushes of the robot setup."
        )


def _check_existing(task: Task, existing: Existing) -> None:
    info, card, path = task.store.info, existing.card, existing.folder / CARD
    pairs = {
        "kind": (card.kind, info.kind),
        "time_step": (card.time_step, info.time_step),
        "recipe.horizon": (card.recipe.horizon, task.recipe.horizon.kind),
        "identity.kind": (card.identity.kind, task.model),
    }
    for name, (found, wanted) in pairs.items():
        if found != wanted:
            raise BadCheckpoint(
                f"{path}: {name} is {found!r}, this training's is {wanted!r}; give "
                "`start` another network."
            )
    _check_internal_engine(task, existing)
    existing.network.made_for.check_disks(info.bodies, str(path))
    given, wanted = card.identity.features, task.recipe.features
    if given != wanted and (given, wanted) != ("paper", "place"):
        raise BadCheckpoint(
            f"{path}: features is {given!r}; give `features` {given}, too."
        )


def _check_internal_engine(task: Task, existing: Existing) -> None:
    """Raise `BadCheckpoint` if the network was trained around too different an engine.

    An identified engine is the planar one with other parameters: training around it may
    start from a network that was trained around the planar engine.
    """
    found = existing.card.identity.simulator
    wanted = task.inner.simulator if task.inner else None
    if found == wanted or (_is_planar_like(found) and _is_identified(wanted)):
        return
    names = [spec.slug if spec else None for spec in (found, wanted)]
    raise BadCheckpoint(
        f"{existing.folder / CARD}: the internal engine is {names[0]!r}, this "
        f"training's is {names[1]!r}; give `start` another network."
    )


def _is_identified(spec: SimulatorSpec | None) -> bool:
    return spec is not None and spec.is_identified


def _is_planar_like(spec: SimulatorSpec | None) -> bool:
    return spec == PlanarSpec() or _is_identified(spec)


def _check_single_steps(task: Task) -> None:
    info, path = task.store.info, task.store.path
    if info.kind != "robot" or info.is_recorded:
        raise BadStore(
            f"{path}: single steps need simulated pushes of the robot setup, whose "
            "state is known at every step; train on whole pushes."
        )
    if task.inner and task.inner.simulator.build().on_host:
        raise BadInput(
            f"`engine` is {task.inner.simulator.slug}, which cannot restart at "
            "every step of a training; use planar, or train on whole pushes."
        )


def _check_contacts(task: Task) -> None:
    info, path = task.store.info, task.store.path
    if info.kind != "robot":
        raise BadStore(
            f"{path}: kind is {info.kind!r}; the features 'contact' need the path of "
            "the pusher, give pushes of the robot setup."
        )
    if task.inner is None or not (task.is_additive or task.existing):
        raise BadInput(
            "`features` is contact: such a network adds to an engine; train sain, and "
            f"give `start` {FROM_ENGINE}."
        )
