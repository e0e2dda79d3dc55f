"""Identification and training in scripts."""

from contextlib import AbstractContextManager, nullcontext
from numbers import Integral
from os import PathLike, fspath
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, cast, get_args

from sainet.api.engines import register
from sainet.api.models import Loadable, load
from sainet.api.progress import shown_progress
from sainet.api.pushes import Dataset, store_of
from sainet.datasets.store import Store
from sainet.engines.simulator import SIMULATORS, InternalEngine
from sainet.identification.identify import identify as estimate
from sainet.identification.identify import identify_into
from sainet.learning.fit import fit
from sainet.learning.log import reported
from sainet.learning.process import fit_process, fits_of
from sainet.learning.recipes import FROM_ENGINE, Recipe, recipe_for, start_named
from sainet.models.identity import LEARNED, ModelKind, ProcessFeatures
from sainet.models.library import engine_of, find_internal_engine, identified_physics
from sainet.models.model import Model
from sainet.models.process_card import ProcessSettings
from sainet.runs.documents import checked
from sainet.runs.errors import BadInput, require_one_of

Folder = PathLike[str] | str


def identify(
    pushes: Dataset,
    *,
    engine: Loadable = "planar",
    out: Folder | None = None,
    progress: bool | None = None,
) -> Model:
    """Estimate frictions, pressure distribution and camera offset from pushes.

    Args:
        pushes: along paths, observed at least at their ends.
        engine: the planar engine, or one of your own (`from_step`, `from_mjcf`): of
            that, frictions and camera offset are estimated, as far as its step depends
            on the frictions of the scene. Outside JAX, derivatives are finite
            differences.
        out: run folder to write, which commands take as a model; None: no files.
        progress: show a progress bar; None: on a terminal.

    Returns:
        The engine with the estimated parameters, as a model. `identified` has
        the estimates with 95 % intervals, and which are not identifiable: these keep
        their initial values.

    Raises:
        BadStore: no pose was observed, or forces drive the pusher.
        BadInput: the engine has no derivatives.
        RunConflict: the folder belongs to another run.
    """
    store, simulator = store_of(pushes), _internal(engine).simulator
    title = f"Fitting to {store.info.pushes} pushes"
    with shown_progress(title, None, progress) as advance:

        def on_try(error: float) -> None:
            advance(1, f"error {error:.3f}")

        if out is not None:
            identify_into(store, Path(out), simulator=simulator, on_try=on_try)
            return load(out)
        return identified_physics(estimate(store, simulator, on_try=on_try))


def tune(
    model: ModelKind | Literal["gp"],
    pushes: Dataset,
    *,
    engine: Loadable | None = None,
    features: ProcessFeatures | None = None,
    choose: bool = False,
    start: Folder | Model = FROM_ENGINE,
    recipe: Recipe | None = None,
    iterations: int | None = None,
    seed: int | None = None,
    out: Folder | None = None,
    progress: bool | None = None,
) -> Model:
    """Train a network, or fit a Gaussian process, on few pushes.

    Args:
        model: `sain`, a network around an engine, or `in`, a network without one; or
            `gp`, a Gaussian process around an engine, for pushes of one or two disks.
        pushes: to train on.
        engine: internal engine: identified physics, a simulator whose prediction the
            dataset contains, or a folder of identified parameters. None: `planar` for
            SAIN; `gp` identifies the engine on the same pushes.
        features: inputs of a Gaussian process, each with those before: `angle` (of the
            contact), `side` (of the disk), `place` (on the table). None: `side`. For
            a network give `recipe` other features.
        choose: choose the kernel of a Gaussian process, and its inputs up to
            `features`, by cross-validation on the pushes: up to nine times as long.
        start: of a network. `engine` starts as the internal engine, with a network that
            adds nothing to its motion at first; otherwise a network to train further:
            shipped, its folder, or a model with a folder.
        recipe: settings of training, for example
            ``recipe_for(FromSimulator()).changed(l2=0.01)``; with a start of its own.
            None: the recipe that fits `start`.
        iterations: gradient steps, or iterations of the fit of a process; None: the
            usual number.
        seed: of everything random; None: that of the recipe.
        out: run folder, with the network and the log of its training; an identical
            call resumes. None: a temporary folder, deleted at the end.
        progress: show a progress bar; None: on a terminal.

    Raises:
        BadSetting: there is no such kind of model.
        BadStore: the data lack inputs of the network.
        BadCheckpoint: training cannot start from that network.
        RunConflict: the folder belongs to another run.
        Diverged: the loss became NaN or infinite.
    """
    require_one_of("model", model, LEARNED)
    given = {"iterations": _plain(iterations), "seed": _plain(seed)}
    if model == "gp":
        if recipe is not None or start != FROM_ENGINE:
            raise BadInput("`recipe` and `start` are of networks; leave them out.")
        given |= {"features": features, "choose": choose}
        known = {k: v for k, v in given.items() if v is not None}
        require_one_of("features", features or "side", get_args(ProcessFeatures))
        settings = checked(ProcessSettings(**cast(Any, known)), "gp")
        return _fitted(store_of(pushes), settings, engine, out, progress)
    if features is not None or choose:
        raise BadInput("`features` and `choose` are of `gp`; change the `recipe`.")
    begun = _recipe(start, recipe)
    settings = begun.changed(**{k: v for k, v in given.items() if v is not None})
    total = settings.optimiser.iterations
    with _folder(out) as folder:
        with shown_progress(f"Training {model.upper()}", total, progress) as advance:
            fit(
                model,
                store_of(pushes),
                settings,
                Path(folder),
                engine=_internal(engine or "planar"),
                on_step=reported(advance),
            )
        found = load(folder)
    return found if out is not None else found.without_folder()


def _plain(number: int | None) -> int | None:
    return int(number) if isinstance(number, Integral) else number  # of NumPy


def _recipe(start: Folder | Model, recipe: Recipe | None) -> Recipe:
    """Return the recipe that fits a start, or the one that is given.

    Raises:
        BadInput: the recipe has another start than the one that is given.
    """
    wanted = start_named(_start_name(start))
    if recipe is None:
        return recipe_for(wanted)
    if start != FROM_ENGINE and recipe.start != wanted:
        raise BadInput(
            f"`start` is {_start_name(start)}, and `recipe` has another start; leave "
            "`start` out, or give `recipe_for` that start."
        )
    return recipe


def _fitted(
    store: Store,
    settings: ProcessSettings,
    engine: Loadable | None,
    out: Folder | None,
    progress: bool | None,
) -> Model:
    def identified(folder: Path) -> InternalEngine:
        return identify_into(store, folder).engine

    internal = identified if engine is None else _internal(engine)
    title = f"Fitting to {store.info.pushes} pushes"
    with _folder(out) as folder:
        with shown_progress(title, fits_of(store, settings), progress) as advance:
            fit_process(
                store,
                Path(folder),
                internal,
                settings,
                on_output=lambda: advance(1, ""),
            )
        found = load(folder)
    return found if out is not None else found.without_folder()


def _start_name(start: Folder | Model) -> str:
    if not isinstance(start, Model):
        return fspath(start)
    if start.folder is None:
        raise BadInput(
            f"`start` is {start.name}, which has no folder; train it with `out`."
        )
    return str(start.folder)


def _internal(engine: Loadable) -> InternalEngine:
    if isinstance(engine, str) and engine in SIMULATORS:
        return find_internal_engine(engine)
    found = load(engine)
    if found.internal is None or found.card is not None:
        raise BadInput(
            f"`engine` is {found.name}; it must be physics: identified, an engine of "
            f"your own, or one of {', '.join(SIMULATORS)}."
        )
    register(found)
    return engine_of(found.identified) if found.identified else found.internal


def _folder(out: Folder | None) -> AbstractContextManager[str]:
    return TemporaryDirectory() if out is None else nullcontext(fspath(out))
