"""Dynamics models behind one `predict`: physics, a corrector, and both together."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float, UInt64

from sainet.engines.base import AbstractEngine
from sainet.models.correctors import AbstractCorrector, Purpose, Region, Start
from sainet.models.inputs import push_frame
from sainet.runs.errors import BadCheckpoint, require
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory, unpack_motion

Carry = Any  # what a prediction continues from; each model has a type of its own
Given = Trajectory | None  # a stored simulator prediction
Hashes = UInt64[np.ndarray, " push"]


class AbstractDynamics(eqx.Module):
    """Predicts how scenes move; all arguments share one leading axis, push.

    Arrays of a `State` are [push, body, ...], of its pusher [push, 2]; those of
    `Controls` [push, time, 2]; those of a `Trajectory` [push, time, body, ...], its
    pusher [push, time, 2]. `from_function` makes dynamics of a function on arrays.

    `begin` restarts everything at the state that it is given; `advance` never does,
    so that two advances equal one long one. Contact networks hold their output for
    some steps (8 by default): only cuts after a multiple of these leave it unchanged.
    """

    @property
    def on_host(self) -> bool:
        """Whether its engine works outside JAX: then only parts are compiled."""
        return False

    @property
    def engine_alone(self) -> "AbstractDynamics | None":
        """Its engine without a corrector; None if it has none, or one on the host.

        Planners screen sequences of pushes with it.
        """
        return None

    @property
    def made_for(self) -> Purpose | None:
        """The pushes that its corrector is for; None without a corrector."""
        return None

    @property
    def has_regions(self) -> bool:
        """Whether `region` states where pushes end."""
        return False

    def recall(
        self, hashes: Callable[[], Hashes], steps: int, bodies: int
    ) -> np.ndarray | None:
        """Return predictions of stored pushes that were made elsewhere.

        Args:
            hashes: returns the hash of each push.
            steps: of the longest push.
            bodies: of each push.

        Returns:
            Poses (m, m, rad) [push, time, body, 3], or final ones [push, body, 3]; None
            for a model that predicts here.
        """
        del hashes, steps, bodies
        return None

    def region(self, scene: Scene, state: State, controls: Controls) -> Region | None:
        """Return the regions in which pushes end; None where they are not known.

        Args:
            scene: of each push.
            state: at the start of each push.
            controls: of each push.
        """
        del scene, state, controls
        return None

    @abstractmethod
    def begin(self, scene: Scene, state: State) -> Carry:
        """Return the carry of a push that starts at a state."""

    @abstractmethod
    def advance(
        self, scene: Scene, carry: Carry, controls: Controls, simulated: Given = None
    ) -> tuple[Carry, Trajectory]:
        """Return the carry and the states after each step of the controls.

        Args:
            scene: of each push.
            carry: of each push, from `begin` or the last `advance`.
            controls: of each push.
            simulated: stored simulator prediction of these steps by the model's engine,
                which is then not run; None runs it. A model without an engine ignores
                it. See `stored_prediction`.
        """


class PhysicsDynamics(AbstractDynamics):
    """An engine without a corrector."""

    engine: AbstractEngine

    @property
    def on_host(self) -> bool:
        """Whether the engine works outside JAX."""
        return self.engine.on_host

    def begin(self, scene: Scene, state: State) -> State:
        """Start at the state."""
        return state

    def advance(
        self, scene: Scene, carry: State, controls: Controls, simulated: Given = None
    ) -> tuple[State, Trajectory]:
        """Roll the engine out."""
        if simulated is None:
            simulated = self.engine.rollout(scene, carry, controls)
        return simulated.final, simulated


class LearnedDynamics(AbstractDynamics):
    """A corrector without an engine (IN; eq. 4 to 7)."""

    network: AbstractCorrector

    @property
    def made_for(self) -> Purpose:
        """The pushes that the corrector is for."""
        return self.network.made_for

    def begin(self, scene: Scene, state: State) -> Start:
        """Start at the state, in the frame of its push."""
        return Start(state, push_frame(scene, state))

    def advance(
        self, scene: Scene, carry: Start, controls: Controls, simulated: Given = None
    ) -> tuple[Start, Trajectory]:
        """Apply the corrector recurrently."""
        del simulated
        trajectory = self.network.correct(scene, carry, controls, None).trajectory
        return Start(trajectory.final, carry.frame), trajectory


class SimulatorAugmented(AbstractDynamics):
    """A corrector around an engine (SAIN; eq. 8 to 12).

    The engine runs open loop: s-bar depends on the start and the actions only.
    """

    network: AbstractCorrector
    engine: AbstractEngine

    @property
    def on_host(self) -> bool:
        """Whether the engine works outside JAX."""
        return self.engine.on_host

    @property
    def engine_alone(self) -> PhysicsDynamics | None:
        """Its engine, unless that works outside JAX."""
        return None if self.on_host else PhysicsDynamics(self.engine)

    @property
    def made_for(self) -> Purpose:
        """The pushes that the corrector is for."""
        return self.network.made_for

    @property
    def has_regions(self) -> bool:
        """Whether the corrector states regions."""
        return self.network.has_regions

    def begin(self, scene: Scene, state: State) -> Start:
        """Start both predictions at the state (eq. 2: s-bar0 = s-hat0 = s0)."""
        return Start(state, push_frame(scene, state), state, state)

    def advance(
        self, scene: Scene, carry: Start, controls: Controls, simulated: Given = None
    ) -> tuple[Start, Trajectory]:
        """Roll the engine out, then correct it step by step."""
        if simulated is None:
            assert carry.simulated is not None
            simulated = self.engine.rollout(scene, carry.simulated, controls)
        trajectory = self.network.correct(scene, carry, controls, simulated).trajectory
        reached = Start(trajectory.final, carry.frame, simulated.final, carry.first)
        return reached, trajectory

    def region(self, scene: Scene, state: State, controls: Controls) -> Region | None:
        """Return the regions of the corrector."""
        return self.network.region(scene, self.begin(scene, state), controls)


def stored_prediction(
    motion: Float[Array, "push time body 6"], initial: State, controls: Controls
) -> Trajectory:
    """Return a stored simulator prediction in the form that `advance` takes.

    Args:
        motion: packed s-bar after each step, in the table frame.
        initial: state at the start of the push.
        controls: of the push. Where a force drives the pusher its path is not stored:
            the trajectory then has it at its start, and `advance` must not continue.
    """
    pusher = controls.pusher_motion(initial.pusher_position)
    return Trajectory(unpack_motion(motion, *pusher))


SAME_TIME = 1e-9  # s, difference below which time steps are equal


def check_purpose(
    dynamics: AbstractDynamics, kind: str, time_step: float, disks: int
) -> None:
    """Raise `BadCheckpoint` if a network is for other steps, controls or disks.

    Its predictions would be wrong without any other sign.

    Args:
        dynamics: the model.
        kind: setup of the pushes, `Controls.kind`.
        time_step: of the scene, s.
        disks: number of disks of the scene.
    """
    made_for = dynamics.made_for
    if made_for is None:
        return
    made_for.check_disks(disks)
    if made_for.kind != kind:
        raise BadCheckpoint(
            f"model: its network is for {made_for.kind} pushes, these are {kind} "
            f"pushes; train a network on {kind} pushes."
        )
    if abs(made_for.time_step - time_step) > SAME_TIME:
        raise BadCheckpoint(
            f"model: its network has a time step of {made_for.time_step:g} s, the "
            f"scene {time_step:g} s; give the scene the same time step."
        )


def predict(
    dynamics: AbstractDynamics,
    scene: Scene,
    initial: State,
    controls: Controls,
    simulated: Trajectory | None = None,
) -> Trajectory:
    """Return the states after each step of the controls.

    Works on one scene or on a batch of them (one leading axis).

    Args:
        dynamics: the model.
        scene: of each push.
        initial: state at the start of each push.
        controls: of each push.
        simulated: stored simulator prediction, see `AbstractDynamics.advance`.

    Raises:
        BadSetting: the first argument has no dynamics, for example a name.
    """
    is_dynamics = isinstance(dynamics, AbstractDynamics)  # pyright: ignore
    require(is_dynamics, "dynamics", "the field `dynamics` of a Model", dynamics)
    roll = _roll if simulated is None and dynamics.on_host else _compiled
    return roll(dynamics, (scene, initial, controls, simulated))


_Push = tuple[Scene, State, Controls, Trajectory | None]


def _roll(dynamics: AbstractDynamics, push: _Push) -> Trajectory:
    scene, initial, controls, simulated = push
    if not scene.batch_shape:
        batch = jax.tree.map(lambda x: x[None], push)
        return jax.tree.map(lambda x: x[0], _roll(dynamics, batch))
    carry = dynamics.begin(scene, initial)
    return dynamics.advance(scene, carry, controls, simulated)[1]


_compiled = eqx.filter_jit(_roll)
