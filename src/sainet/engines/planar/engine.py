"""The planar engine: single steps and rollouts."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from sainet.engines.base import AbstractEngine
from sainet.engines.planar import contact, solver
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory


class PlanarEngine(AbstractEngine):
    """Disks and a cylindrical pusher on a table, in JAX: batched and differentiable.

    Semi-implicit Euler: the velocities at the end of a step satisfy Coulomb contact
    without restitution between all pairs, and the ellipsoidal limit surface of each
    pressed disk; then ``p(t+1) = p(t) + dt * v(t+1)``. The engine computes in the
    precision of its inputs and is stateless.

    Attributes:
        pressure_radius_ratio: mean distance of the pressure from the centre over the
            radius: 2/3 when it is uniform, 1 when the disk rests on its rim.
        sweeps: of the solver over all contacts, in each step.
        recovery: fraction of an overlap that each step removes.
    """

    pressure_radius_ratio: float | Float[Array, ""] = 2 / 3
    sweeps: int = eqx.field(static=True, default=10)
    recovery: float = eqx.field(static=True, default=0.08)

    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Return the states after each step of the controls."""
        properties = self._properties(scene, controls)

        def advance(
            bodies: contact.Bodies, control: Array
        ) -> tuple[contact.Bodies, State]:
            moved = self._step(scene, properties, bodies, controls, control)
            return moved, contact.to_state(moved)

        command = jnp.moveaxis(controls.command, -2, 0)
        _, states = lax.scan(advance, contact.to_bodies(initial), command)
        time = len(scene.batch_shape)  # axis behind those of the batch
        return Trajectory(jax.tree.map(lambda x: jnp.moveaxis(x, 0, time), states))

    def step(
        self,
        scene: Scene,
        state: State,
        controls: Controls,
        control: Float[Array, "*batch 2"],
    ) -> State:
        """Return the state one step later.

        Args:
            scene: any batch shape.
            state: of the same batch shape.
            controls: drive the pusher.
            control: one step of `controls.command`.
        """
        properties = self._properties(scene, controls)
        bodies = contact.to_bodies(state)
        return contact.to_state(
            self._step(scene, properties, bodies, controls, control)
        )

    def _properties(self, scene: Scene, controls: Controls) -> contact.Properties:
        inverse_mass = 1 / controls.pusher.mass
        return contact.to_properties(scene, self.pressure_radius_ratio, inverse_mass)

    def _step(
        self,
        scene: Scene,
        properties: contact.Properties,
        bodies: contact.Bodies,
        controls: Controls,
        control: Float[Array, "*batch 2"],
    ) -> contact.Bodies:
        bodies = _drive(bodies, controls, control, scene.time_step)
        limits = _table_limits(scene, properties, bodies)
        step = solver.Step(scene.time_step, self.recovery, self.sweeps)
        are_few = len(solver.every_pair(len(bodies.x))) <= solver.MOST_PAIRS
        solve = solver.solve_all_pairs if are_few else solver.solve_close_pairs
        twists = solve(bodies, properties, limits, step)
        return _integrate(bodies, twists, scene.time_step)


def _drive(
    bodies: contact.Bodies, controls: Controls, control: Array, time_step: float
) -> contact.Bodies:
    """Return the bodies with the pusher's velocity before contact."""
    vx, vy = controls.drive(
        (bodies.x[-1], bodies.y[-1]),
        (bodies.velocity_x[-1], bodies.velocity_y[-1]),
        (control[..., 0], control[..., 1]),
        time_step,
    )
    return bodies._replace(
        velocity_x=(*bodies.velocity_x[:-1], vx),
        velocity_y=(*bodies.velocity_y[:-1], vy),
    )


def _table_limits(
    scene: Scene, properties: contact.Properties, bodies: contact.Bodies
) -> tuple[Array, ...]:
    """Return the largest impulse of table friction on each disk (N s)."""
    impulse = properties.table_friction * scene.time_step
    limits = tuple(impulse * weight for weight in properties.weight)
    if scene.friction_field is None:
        return limits
    field = scene.friction_field
    places = zip(limits, bodies.x, bodies.y, strict=False)
    return tuple(limit * field.at(x, y) for limit, x, y in places)


def _integrate(
    bodies: contact.Bodies, twists: tuple[contact.Twist, ...], time_step: float
) -> contact.Bodies:
    vx, vy, spin = zip(*twists, strict=True)
    return contact.Bodies(
        x=tuple(p + time_step * v for p, v in zip(bodies.x, vx, strict=True)),
        y=tuple(p + time_step * v for p, v in zip(bodies.y, vy, strict=True)),
        angle=tuple(a + time_step * w for a, w in zip(bodies.angle, spin, strict=True)),
        velocity_x=vx,
        velocity_y=vy,
        spin=spin,
    )
