"""Dynamics models behind one `predict`: physics, the network, and both together."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.engines.base import AbstractEngine
from sainet.models.features import drives, still_features
from sainet.models.frame import (
    PushFrame,
    controls_to_frame,
    motion_from_frame,
    motion_to_frame,
    push_frame,
)
from sainet.models.interaction import InteractionNetwork, unroll
from sainet.scenes.controls import Controls, PathControls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory, pack_motion, unpack_motion


class Purpose(NamedTuple):
    """What a network was made for."""

    kind: str  # of the controls
    time_step: float  # s


class AbstractDynamics(eqx.Module):
    """Predicts how scenes move; all arguments share one leading batch axis.

    `begin` restarts everything at the state that it is given; `advance` never does,
    so that two advances equal one long one.
    """

    @property
    def on_host(self) -> bool:
        """Whether an engine in it works outside JAX: then only parts are compiled."""
        return False

    @property
    def made_for(self) -> Purpose | None:
        """What the network in it was made for; None if there is no network in it."""
        return None

    @abstractmethod
    def begin(self, scene: Scene, state: State) -> Any:  # noqa: ANN401
        """Return the carry of a push that starts at a state."""

    @abstractmethod
    def advance(
        self,
        scene: Scene,
        carry: Any,  # noqa: ANN401
        controls: Controls,
    ) -> tuple[Any, Trajectory]:
        """Return the carry and the states after each step of the controls."""


class PhysicsDynamics(AbstractDynamics):
    """An engine alone."""

    engine: AbstractEngine

    @property
    def on_host(self) -> bool:
        """Whether the engine works outside JAX."""
        return self.engine.on_host

    def begin(self, scene: Scene, state: State) -> State:
        """Start at the state."""
        return state

    def advance(
        self, scene: Scene, carry: State, controls: Controls
    ) -> tuple[State, Trajectory]:
        """Roll the engine out."""
        trajectory = self.engine.rollout(scene, carry, controls)
        return trajectory.final, trajectory


class LearnedCarry(eqx.Module):
    """Where a network's prediction stands."""

    predicted: State  # s-hat, goes back into the network
    frame: PushFrame


class LearnedDynamics(AbstractDynamics):
    """The interaction network alone (IN; eq. 4 to 7)."""

    network: InteractionNetwork

    @property
    def made_for(self) -> Purpose:
        """What the network was made for."""
        return _purpose(self.network)

    def begin(self, scene: Scene, state: State) -> LearnedCarry:
        """Start at the state, in the frame of its push."""
        return LearnedCarry(state, push_frame(scene, state))

    def advance(
        self, scene: Scene, carry: LearnedCarry, controls: Controls
    ) -> tuple[LearnedCarry, Trajectory]:
        """Apply the network recurrently."""
        trajectory = _correct(self.network, scene, carry, controls)
        return LearnedCarry(trajectory.final, carry.frame), trajectory


class HybridCarry(eqx.Module):
    """Where the prediction of SAIN stands."""

    simulated: State  # s-bar, goes back into the engine
    predicted: State  # s-hat, goes back into the network
    frame: PushFrame


class SimulatorAugmented(AbstractDynamics):
    """The interaction network around an engine (SAIN; eq. 8 to 12).

    The engine runs open loop: s-bar depends on the start and the actions alone.
    """

    network: InteractionNetwork
    engine: AbstractEngine

    @property
    def on_host(self) -> bool:
        """Whether the engine works outside JAX."""
        return self.engine.on_host

    @property
    def made_for(self) -> Purpose:
        """What the network was made for."""
        return _purpose(self.network)

    def begin(self, scene: Scene, state: State) -> HybridCarry:
        """Start both predictions at the state (eq. 2: s-bar0 = s-hat0 = s0)."""
        return HybridCarry(state, state, push_frame(scene, state))

    def advance(
        self, scene: Scene, carry: HybridCarry, controls: Controls
    ) -> tuple[HybridCarry, Trajectory]:
        """Roll the engine out, then correct it step by step."""
        simulated = self.engine.rollout(scene, carry.simulated, controls)
        learned = LearnedCarry(carry.predicted, carry.frame)
        start, s_bar = pack_motion(carry.simulated), pack_motion(simulated.states)
        trajectory = _correct(
            self.network,
            scene,
            learned,
            controls,
            simulated_start=start,
            simulated=s_bar,
        )
        return HybridCarry(simulated.final, trajectory.final, carry.frame), trajectory


def _purpose(network: InteractionNetwork) -> Purpose:
    return Purpose(network.sizes.kind, network.time_step)


def predict_motion(
    network: InteractionNetwork,
    scene: Scene,
    carry: LearnedCarry,
    controls: Controls,
    *,
    simulated_start: Float[Array, "push body 6"] | None = None,
    simulated: Float[Array, "push time body 6"] | None = None,
    unroll: Callable[..., Array] = unroll,
) -> Float[Array, "time push body 6"]:
    """Unroll a network in the push frame; the result stays in that frame.

    Args:
        network: IN or SAIN.
        scene: of each push.
        carry: where the prediction stands.
        controls: in the table's frame.
        simulated_start: packed motion that s-bar goes on from, table's frame.
        simulated: packed s-bar after each step, table's frame; None for IN.
        unroll: how; training has another way.
    """
    frame = carry.frame
    start = motion_to_frame(pack_motion(carry.predicted), frame)
    local = None if simulated is None else _path_to_frame(simulated, frame)
    before = (
        start if simulated_start is None else motion_to_frame(simulated_start, frame)
    )
    drive = drives(controls_to_frame(controls, frame), before, local)
    return unroll(network, start, still_features(scene, frame, network.sizes), drive)


def _path_to_frame(motion: Array, frame: PushFrame) -> Array:
    return jax.vmap(motion_to_frame, in_axes=(1, None), out_axes=1)(motion, frame)


@eqx.filter_jit
def _correct(
    network: InteractionNetwork,
    scene: Scene,
    carry: LearnedCarry,
    controls: Controls,
    *,
    simulated_start: Array | None = None,
    simulated: Array | None = None,
) -> Trajectory:
    local = predict_motion(
        network,
        scene,
        carry,
        controls,
        simulated_start=simulated_start,
        simulated=simulated,
    )
    motion = jax.vmap(motion_from_frame, in_axes=(0, None), out_axes=1)(
        local, carry.frame
    )
    pusher, velocity = _commanded_pusher(carry.predicted, controls)
    return Trajectory(unpack_motion(motion, pusher, velocity))


def _commanded_pusher(state: State, controls: Controls) -> tuple[Array, Array]:
    """Return the pusher's path as far as it is known: a force does not tell it."""
    if isinstance(controls, PathControls):
        return controls.position, controls.velocity
    shape = controls.force.shape
    still = jnp.broadcast_to(state.pusher_position[..., None, :], shape)
    return still, jnp.zeros(shape)


def predict(
    dynamics: AbstractDynamics, scene: Scene, initial: State, controls: Controls
) -> Trajectory:
    """Return the states after each step of the controls.

    Works on one scene or on a batch of them (one leading axis).
    """
    if scene.batch_shape:
        return _predict(dynamics, scene, initial, controls)
    batch = jax.tree.map(lambda x: x[None], (scene, initial, controls))
    return jax.tree.map(lambda x: x[0], _predict(dynamics, *batch))


def _predict(
    dynamics: AbstractDynamics, scene: Scene, initial: State, controls: Controls
) -> Trajectory:
    if dynamics.on_host:
        return _roll(dynamics, scene, initial, controls)
    return _compiled(dynamics, scene, initial, controls)


def _roll(
    dynamics: AbstractDynamics, scene: Scene, initial: State, controls: Controls
) -> Trajectory:
    carry = dynamics.begin(scene, initial)
    return dynamics.advance(scene, carry, controls)[1]


_compiled = eqx.filter_jit(_roll)
