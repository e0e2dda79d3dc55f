"""Models: a dynamics model with its identity, and the card of its network."""

import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
from jaxtyping import UInt64

from sainet.engines import RECORDED
from sainet.engines.simulator import InternalEngine
from sainet.models.card import Card, Identified
from sainet.models.dynamics import SAME_TIME, AbstractDynamics, check_purpose, predict
from sainet.models.identity import ModelId
from sainet.models.process_card import ProcessCard
from sainet.models.push_inputs import (
    check_axes,
    check_parts,
    compiled,
    is_traced,
    kind_of,
    predict_push,
    steps_of,
    untrained,
    widened,
)
from sainet.runs.digests import pushes_overlap
from sainet.runs.errors import BadCheckpoint, BadInput, BadScene
from sainet.scenes.controls import Controls
from sainet.scenes.pushes import Push
from sainet.scenes.quantities import MOST_STEPS, require_count
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory


@dataclass(frozen=True)
class Model:
    """A dynamics model, its identity, and the card of its network if it has one.

    Attributes:
        id: what it is, from which its name follows.
        dynamics: predicts; planners take it as well as the model.
        card: of its network.
        folder: of a trained network or of identified parameters.
        digest: hash of the weights or of the identified parameters.
        internal: engine that predicts s-bar for the dynamics.
        identified: estimates of identified physics.
    """

    id: ModelId
    dynamics: AbstractDynamics
    card: Card | ProcessCard | None = None
    folder: Path | None = None
    digest: str | None = None
    internal: InternalEngine | None = None
    identified: Identified | None = None

    def __repr__(self) -> str:
        """Return name and kind in one line."""
        label = "" if self.name == self.id.label else f": {self.id.label}"
        return f"<Model {self.name}{label}>"

    @property
    def name(self) -> str:
        """The name in tables and JSON."""
        return self.id.slug

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups of recorded pushes that it was fitted to; empty if not known."""
        source = self.card or self.identified
        return (source.groups or ()) if source else ()

    def called(self, name: str) -> "Model":
        """Return the model under another name in tables and JSON.

        Args:
            name: in the place of the model's own.
        """
        if self.name == name:
            return self
        return replace(self, id=msgspec.structs.replace(self.id, name=name))

    def without_folder(self) -> "Model":
        """Return the model in memory; its folder and the folder's name are gone."""
        identity = self.card.identity if self.card else self.id
        return replace(self, id=identity, folder=None)

    def predict(
        self,
        scene: Scene,
        state: State,
        push: Push | Controls,
        *,
        steps: int | None = None,
    ) -> Trajectory:
        """Return the motion of disks that a push moves.

        Scene, state and push may each have one leading axis, push; a part without it
        is used for all. `jax.vmap`, `jax.jit` and `jax.grad` apply where the model is
        JAX throughout (`dynamics.on_host` is False).

        Args:
            scene: properties given to the model.
            state: poses of the disks at rest, position [body, 2] (m), angle [body]
                (rad). With controls: the complete state at their start.
            push: parameters of a straight push; the pusher starts where it touches
                disk 1. Or the controls of one.
            steps: number of steps of 1/240 s of a `Push`; None: until it has ended and
                the disks rest, 200 for a push of 10 mm at 50 mm/s. Of a push whose
                length or speed is traced, None is 200.

        Returns:
            States after each step: `trajectory.states.position` is [time, body, 2] (m),
            `trajectory.final` the last state; batches have a leading axis.

        Raises:
            BadScene: a push or a property is out of range, the state is not finite, or
                the parts do not fit each other.
            BadCheckpoint: the network is for other pushes or another time step.
            BadInput: the model is not JAX, and the push is traced.
            BadSetting: a part is not of its type, or the number of steps is no whole
                number from 1.
        """
        if steps is not None:
            require_count("steps", steps, high=MOST_STEPS)
            steps = int(steps)  # one of NumPy would be traced
        check_parts(scene, state, push)
        if scene.body_count != state.body_count:
            raise BadScene(
                f"state: it has {state.body_count} disks, the scene {scene.body_count}."
            )
        if self.dynamics.on_host and is_traced((scene, state, push)):
            raise BadInput(
                f"{self.name} does not run in JAX, which cannot trace it; give a batch "
                "of pushes."
            )
        check_purpose(self.dynamics, kind_of(push), scene.time_step, scene.body_count)
        check_axes(scene, state, push)
        if not isinstance(push, Push):
            return predict(self.dynamics, *widened(scene, state, push))
        steps = steps_of(push, scene.time_step) if steps is None else steps
        if scene.body_count > 1 and not is_traced(push):
            self._warn_of_untrained(push)
        run = predict_push if self.dynamics.on_host else compiled
        return run(self.dynamics, scene, state, push, steps)

    def _warn_of_untrained(self, push: Push) -> None:
        """Warn, where `predict` was called, of directions outside the training range.

        The range of recorded pushes is not known, nor that of lengths and speeds.
        """
        if isinstance(self.card, Card) and self.card.truth_engine != RECORDED:
            for doubt in untrained(push, "contact angle", "direction"):
                warnings.warn(f"push: {doubt}", stacklevel=3)

    def check_fits(
        self,
        kind: str,
        time_step: float,
        *,
        disks: int | None = None,
        seed: int | None = None,
        pushes: UInt64[np.ndarray, " push"] | None = None,
    ) -> None:
        """Raise `BadCheckpoint` if the network is not for these pushes.

        Args:
            kind: setup of the pushes.
            time_step: of the pushes (s).
            disks: number of disks in each push; None: unknown.
            seed: of simulated test pushes; None otherwise.
            pushes: hashes of the test pushes (`Store.push_hashes`); None: unknown.
        """
        if self.card is None:
            self._check_unseen(pushes)
            return
        path = f"{self.folder}/{self.card.file}" if self.folder else self.name
        if self.card.kind != kind:
            raise BadCheckpoint(
                f"{path}: kind is {self.card.kind!r}, the data's is "
                f"{kind!r}; train a network on such pushes, or give `force`."
            )
        if abs(self.card.time_step - time_step) > SAME_TIME:
            raise BadCheckpoint(
                f"{path}: time_step is {self.card.time_step} s, the data's is "
                f"{time_step} s; train a network on such data, or give `force`."
            )
        if disks is not None and self.dynamics.made_for is not None:
            self.dynamics.made_for.check_disks(disks, path)
        if seed is not None and seed in self.card.data_seeds:
            raise BadCheckpoint(
                f"{path}: data_seeds has {seed}, the seed of the data: the network may "
                "have been trained on these very pushes. Generate others with another "
                "`seed`, or give `force`."
            )
        self._check_unseen(pushes)

    def _check_unseen(self, pushes: UInt64[np.ndarray, " push"] | None) -> None:
        """Raise `BadCheckpoint` if the model was fitted to some of these pushes."""
        source = self.card or self.identified
        if source is None or pushes is None:
            return
        known = source.digests if isinstance(source, Identified) else source.pushes
        seen = pushes_overlap(known, pushes)
        path = f"{self.folder}/{source.file}" if self.folder else self.name
        if seen:
            raise BadCheckpoint(
                f"{path}: the {source.noun} was {source.made} on {seen} of these "
                f"{len(pushes)} pushes. Test it on others ('sainet split'), or give "
                "`force`."
            )
