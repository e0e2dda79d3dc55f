"""A training run from its folder to its card: begun, resumed, noted and finished."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import msgspec
import numpy as np
from jaxtyping import Array, Float, Int

from sainet.datasets.groups import groups_of
from sainet.datasets.store import Store
from sainet.engines.simulator import InternalEngine
from sainet.learning.log import LogLine, append_log, rewind_log
from sainet.learning.loss import LossWeights
from sainet.learning.mixture import Mixture, Validate
from sainet.learning.recipes import FROM_ENGINE, FromModel, Recipe, Start
from sainet.learning.step import FitState, Trained, trained_layers, with_layers
from sainet.learning.task import Existing, Task
from sainet.models.card import CARD, WEIGHTS, Card
from sainet.models.checkpoint import load_arrays, load_network, save_arrays
from sainet.models.correctors.network import AbstractNetwork
from sainet.models.identity import ModelId, ModelKind, TrainingData
from sainet.models.library import SHIPPED, find_internal_engine, network_folder
from sainet.runs.digests import digests_to_text
from sainet.runs.documents import content_hash, read_document, write_document
from sainet.runs.errors import BadInput, Diverged, UnknownName
from sainet.runs.folders import RunFolder, open_run
from sainet.runs.manifest import MANIFEST, Manifest, manifest
from sainet.scenes.recording import AGREES

STATE = "state.safetensors"


class Best(eqx.Module):
    """Its layers, and when and how good it was; part of a checkpoint."""

    layers: Trained
    loss: Float[Array, ""]  # on the validation pushes
    iteration: Int[Array, ""]

    @staticmethod
    def first(network: AbstractNetwork, loss: float) -> "Best":
        """Return the network that training begins with: it may remain the best."""
        # Any loss is better than one that is not finite.
        known = jnp.nan_to_num(jnp.float32(loss), nan=jnp.finfo(jnp.float32).max)
        return Best(trained_layers(network), known, jnp.int32(0))

    def or_better(
        self, network: AbstractNetwork, loss: float, iteration: int
    ) -> "Best":
        """Return the better one of this and another network."""
        if not loss < float(self.loss):
            return self
        return Best(trained_layers(network), jnp.float32(loss), jnp.int32(iteration))

    def is_stale(self, iteration: int, patience: int) -> bool:
        """Return whether nothing has become better for so many iterations."""
        return 0 < patience <= iteration - int(self.iteration)

    def put_into(self, network: AbstractNetwork) -> AbstractNetwork:
        """Return the network with the best layers."""
        return with_layers(network, self.layers)


@dataclass
class Progress:
    """Everything that changes while training: enough to resume."""

    state: FitState
    best: Best | None  # None without validation pushes
    history: list[LogLine]

    @property
    def last_loss(self) -> float | None:
        """The last logged loss; None before the first."""
        return self.history[-1].loss if self.history else None

    @property
    def network(self) -> AbstractNetwork:
        """The network with which training would end now."""
        network = self.state.result
        return network if self.best is None else self.best.put_into(network)


@dataclass
class Job:
    """A training run that has begun: what it trains, and how far it is."""

    mixture: Mixture
    folder: RunFolder
    progress: Progress
    weights: list[LossWeights]  # of the loss, for each dataset
    drawn_to: Trained | None  # layers that l2 draws towards; None is zero
    validate: Validate | None

    @property
    def recipe(self) -> Recipe:
        """How the network is trained."""
        return self.mixture.lead.recipe

    @property
    def left(self) -> range:
        """The iterations that are left."""
        done = int(self.progress.state.iteration)
        last = done if self._is_stale(done) else self.mixture.lead.iterations
        return range(done + 1, last + 1)

    def note(self, iteration: int, loss: Array) -> bool:
        """Log and save where it is time to; return whether training ends early.

        Raises:
            Diverged: the loss is NaN or infinite.
        """
        progress, recipe, out = self.progress, self.recipe, self.folder.path
        last = iteration == self.mixture.lead.iterations
        if iteration % recipe.log_every == 0 or last:
            _log_line(progress, iteration, float(loss), self.validate, out)
        if iteration % recipe.checkpoint_every == 0 or last:
            save_arrays(out / STATE, (progress.state, progress.best))
        return self._is_stale(iteration)

    def _is_stale(self, iteration: int) -> bool:
        """Return whether validation after this iteration ends the training run."""
        best, recipe = self.progress.best, self.recipe
        if best is None or iteration % recipe.log_every:
            return False
        return best.is_stale(iteration, recipe.stopping.patience)


def begin(
    model: ModelKind,
    store: Store | Sequence[Store],
    recipe: Recipe,
    out: Path,
    *,
    engine: str | InternalEngine = "planar",
) -> Job | None:
    """Return a training run, at its start or where it was interrupted; see `fit`.

    Returns:
        None if it is finished.
    """
    mixture = prepared(model, store, recipe, engine)
    devices = jax.device_count()
    folder = open_run(out, mixture.settings(), finished_by=CARD, devices=devices)
    if folder.is_finished:
        return None
    _warn_of_other_machine(folder, devices)
    state, weights = mixture.begin()
    is_fresh = mixture.lead.existing is None and not mixture.lead.is_additive
    drawn_to = None if is_fresh else trained_layers(state.network)
    validate = mixture.validate(weights)
    best = Best.first(state.network, validate(state.network)) if validate else None
    if (out / STATE).is_file():
        state, best = load_arrays(out / STATE, (state, best))
    history = rewind_log(out, int(state.iteration))
    # Match the step's output device: otherwise its second call compiles again.
    state = jax.device_put(state, jax.devices()[0])
    progress = Progress(state, best, list(history))
    return Job(mixture, folder, progress, weights, drawn_to, validate)


def prepared(
    model: ModelKind,
    store: Store | Sequence[Store],
    recipe: Recipe,
    engine: str | InternalEngine,
) -> Mixture:
    """Return what a training run takes, checked; see `fit`."""
    stores = (store,) if isinstance(store, Store) else tuple(store)
    if not stores:
        raise BadInput("`data` is empty; give at least one dataset.")
    assumed = find_internal_engine(engine)
    pushes = sum(each.info.pushes for each in stores)
    recipe = replace(recipe, objective=recipe.objective.for_pushes(pushes))
    existing = _existing(recipe.start)
    mixture = Mixture(
        tuple(Task(model, each, recipe, assumed, existing) for each in stores)
    )
    mixture.check()
    return mixture


def _existing(start: Start) -> Existing | None:
    if not isinstance(start, FromModel):
        return None
    name = start.model
    if name not in SHIPPED and not Path(name).exists():
        known = ", ".join((FROM_ENGINE, *SHIPPED))
        raise UnknownName(
            f"`start` is {name!r}; it must be {known}, or the folder of a trained "
            "network."
        )
    folder = network_folder(name)
    return Existing(*load_network(folder), folder)


def _warn_of_other_machine(folder: RunFolder, devices: int) -> None:
    before, now = read_document(folder.path / MANIFEST, Manifest), manifest(devices)
    # Manifests once named fewer packages.
    versions = {name: now.versions.get(name) for name in before.versions}
    pairs = {
        "versions": (before.versions, versions),
        "processor": (before.processor, now.processor),
        "devices": (before.devices, now.devices),
    }
    for name, (known, found) in pairs.items():
        if known != found:
            warnings.warn(
                f"{folder.path}: {name} was {known} when training began and is {found} "
                "now; the weights will differ in their last bits.",
                stacklevel=3,
            )


def _log_line(
    progress: Progress,
    iteration: int,
    loss: float,
    validate: Validate | None,
    out: Path,
) -> None:
    if not np.isfinite(loss):
        raise Diverged(
            f"{out}: the loss is {loss} at iteration {iteration}; lower "
            "`learning_rate` or `clip_norm`."
        )
    checked = None
    if validate is not None and progress.best is not None:
        network = progress.state.result
        checked = validate(network)
        progress.best = progress.best.or_better(network, checked, iteration)
    line = LogLine(iteration, loss, checked)
    append_log(out, line)
    progress.history.append(line)


def finish(job: Job) -> None:
    """Write the network and its card: its training run is finished."""
    mixture, progress, folder = job.mixture, job.progress, job.folder
    task, counts = mixture.lead, mixture.counts
    info, sain = task.store.info, task.model == "sain"
    data = save_arrays(folder.path / WEIGHTS, progress.network)
    start = task.existing.card if task.existing else None
    card = Card(
        identity=_identity(task),
        kind=info.kind,
        time_step=info.time_step,
        truth_engine=info.engine,
        integrator=progress.network.integrator.name,
        camera=task.assumed.camera if sain else AGREES,
        data=mixture.content,
        data_seeds=start.data_seeds if start else (),
        disks=counts[-1],
        counts=counts if counts[1:] else msgspec.UNSET,
        trained_pushes=mixture.pushes,
        pushes=_pushes(mixture, start),
        groups=groups_of(mixture.stores) or msgspec.UNSET,
        weights=content_hash(data),
        started_from=start.weights if start else None,
        recipe=task.recipe.settings(),
        manifest=read_document(folder.path / MANIFEST, Manifest),
        final_loss=progress.last_loss,
    )
    write_document(folder.path / CARD, card)
    (folder.path / STATE).unlink(missing_ok=True)


def _identity(task: Task) -> ModelId:
    """Return the identity of the trained network."""
    return ModelId(
        kind=task.model,
        simulator=task.inner.simulator if task.inner else None,
        data=_training_data(task),
        features=task.recipe.features,
        variant="single-steps" if task.has_single_steps else "",
    )


def _training_data(task: Task) -> TrainingData:
    if task.is_additive:
        return "residual"
    if task.existing is None:
        return "real" if task.store.info.is_recorded else "paper"
    if task.store.info.is_recorded:
        return "tuned"
    is_stroke = task.store.info.bodies == 1  # long pushes of one disk
    return "stroke" if is_stroke else task.existing.card.identity.data


def _pushes(mixture: Mixture, start: Card | None) -> str:
    """Return the pushes that the network was ever trained on, as far as known."""
    inner = mixture.lead.inner
    before = start.pushes if start else "", (inner and inner.pushes) or ""
    return digests_to_text(mixture.push_hashes(), *before)
