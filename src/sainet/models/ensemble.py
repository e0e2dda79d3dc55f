"""Ensembles: networks that differ in their seeds, and how far they disagree."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from sainet.engines.base import AbstractEngine
from sainet.models.correctors import Purpose, Region, Start
from sainet.models.correctors.network import AbstractNetwork
from sainet.models.dynamics import AbstractDynamics, Given, PhysicsDynamics
from sainet.models.inputs import push_frame
from sainet.scenes.controls import Controls
from sainet.scenes.geometry import rotate
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory


class Calibration(eqx.Module):
    """What makes 90 % regions of the disagreement of networks, for each body."""

    # Deviation of position (m) and rotation (rad) that is added to the spread of the
    # networks, so that both together are as large as the errors.
    floor: Float[Array, "body 2"]
    # Factors of deviations, and sizes of regions that are the same for all pushes.
    reach: Float[Array, "body 2"]
    plain: Float[Array, "body 2"]


class Spread(eqx.Module):
    """Deviations of the final poses of the networks, in the frame of the push."""

    heading: Float[Array, " push"]  # rad
    place: Float[Array, "push body 2"]  # m, along and across
    turn: Float[Array, "push body"]  # rad


class Ensemble(AbstractDynamics):
    """Predicts the mean of several networks; each continues from its own states."""

    networks: AbstractNetwork  # its arrays have an axis, member, first
    engine: AbstractEngine | None
    calibration: Calibration | None = None

    @property
    def has_regions(self) -> bool:
        """Whether the disagreement was calibrated."""
        return self.calibration is not None

    @property
    def on_host(self) -> bool:
        """Whether the engine works outside JAX."""
        return self.engine is not None and self.engine.on_host

    @property
    def engine_alone(self) -> PhysicsDynamics | None:
        """Its engine, unless it has none or that works outside JAX."""
        if self.engine is None or self.on_host:
            return None
        return PhysicsDynamics(self.engine)

    @property
    def made_for(self) -> Purpose:
        """The pushes that the networks are for."""
        return self.networks.made_for

    def begin(self, scene: Scene, state: State) -> Start:
        """Start every network, and the engine, at the state."""
        count = jax.tree.leaves(eqx.filter(self.networks, eqx.is_array))[0].shape[0]
        each = jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *x.shape)), state)
        frame = push_frame(scene, state)
        return Start(each, frame, None if self.engine is None else state, state)

    def advance(
        self, scene: Scene, carry: Start, controls: Controls, simulated: Given = None
    ) -> tuple[Start, Trajectory]:
        """Roll the engine out once, then let each network correct it."""
        carry, each = self.advance_each(scene, carry, controls, simulated)
        return carry, jax.tree.map(lambda x: jnp.mean(x, axis=0), each)

    def advance_each(
        self, scene: Scene, carry: Start, controls: Controls, simulated: Given = None
    ) -> tuple[Start, Trajectory]:
        """Return the carry and the states of every network, ``[member, push, ...]``."""
        if simulated is None and self.engine is not None:
            assert carry.simulated is not None
            simulated = self.engine.rollout(scene, carry.simulated, controls)

        def correct(network: AbstractNetwork, predicted: State) -> Trajectory:
            start = Start(predicted, carry.frame, carry.simulated, carry.first)
            return network.correct(scene, start, controls, simulated).trajectory

        each = eqx.filter_vmap(correct)(self.networks, carry.predicted)
        reached = None if simulated is None else simulated.final
        after = None if carry.simulated is None else reached
        return Start(each.final, carry.frame, after, carry.first), each

    def spread(self, scene: Scene, state: State, controls: Controls) -> Spread:
        """Return how far the networks disagree about the end of each push."""
        begun = self.begin(scene, state)
        ends = self.advance_each(scene, begun, controls)[1].final
        heading = begun.frame.angle
        off = ends.position - jnp.mean(ends.position, axis=0, keepdims=True)
        return Spread(
            heading=heading,
            place=jnp.std(rotate(off, -heading[None, :, None]), axis=0),
            turn=jnp.std(ends.angle, axis=0),
        )

    def region(self, scene: Scene, state: State, controls: Controls) -> Region | None:
        """Return the regions of the ends; None of other numbers of disks."""
        known = self.calibration
        if known is None or scene.body_count != len(known.reach):
            return None
        found = self.spread(scene, state, controls)
        place, turn = deviations(found, known.floor)
        plain = jnp.broadcast_to(known.plain, (*turn.shape, 2))
        return Region(
            heading=found.heading,
            axes=known.reach[None, :, :1] * place,
            turn=known.reach[None, :, 1] * turn,
            plain=plain,
        )


def deviations(
    found: Spread, floor: Float[Array, "body 2"]
) -> tuple[Float[Array, "push body 2"], Float[Array, "push body"]]:
    """Return deviations of place (m) and turn (rad), never below the floor."""
    place = jnp.sqrt(found.place**2 + floor[None, :, :1] ** 2)
    return place, jnp.sqrt(found.turn**2 + floor[None, :, 1] ** 2)


def stacked(networks: list[AbstractNetwork]) -> AbstractNetwork:
    """Return networks of one form as one, whose arrays have an axis, member, first."""
    arrays = [eqx.partition(each, eqx.is_array) for each in networks]
    joined = jax.tree.map(lambda *x: jnp.stack(x), *(each for each, _ in arrays))
    return eqx.combine(joined, arrays[0][1])
