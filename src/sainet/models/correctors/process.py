"""A Gaussian process on what an engine gets wrong by the end of a push.

Each residual (along and across the push, and in angle, of each body) is a Gaussian
process of the start of the push: a kernel with one length scale for each input, noise.
It grows in proportion to the travel of the pusher, and has a value at every step.
"""

from functools import partial
from typing import cast

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from sainet.models.correctors import (
    AbstractCorrector,
    Prediction,
    Purpose,
    Region,
    Start,
)
from sainet.models.correctors.kernels import KERNELS, KernelName, T
from sainet.scenes.controls import Controls
from sainet.scenes.geometry import direction, norm, rotate, unit, wrap_angle
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory

BODIES = 2  # at most
RESIDUALS = 3  # of a body: along the push (m), across it (m), angle (rad)
_SMALLEST = 1e-6  # m, a shorter travel of the pusher has no direction
_SAME = 1e-12  # squared distance of points that are one
# GPUs would round the factors to ten bits, and differences here are small.
_dot = partial(jnp.matmul, precision=lax.Precision.HIGHEST)


class Inputs(eqx.Module):
    """What a process takes from the start of a push, by name."""

    names: tuple[str, ...] = eqx.field(static=True)

    def of(
        self, scene: Scene, start: Start, heading: Float[Array, " push"]
    ) -> Float[Array, "push input"]:
        """Return the inputs of each push.

        Args:
            scene: of each push.
            start: of each push; `first` is the state at which it began.
            heading: of the pusher on the table (rad).
        """
        assert start.first is not None
        known = known_inputs(scene, start.first, start.frame.pushed, heading)
        return jnp.stack([known[name] for name in self.names], axis=-1)


def known_inputs(
    scene: Scene,
    state: State,
    pushed: Float[Array, "push body"],
    heading: Float[Array, " push"],
) -> dict[str, Float[Array, " push"]]:
    """Return everything that can be an input, by name.

    Args:
        scene: of each push, of one or two bodies.
        state: at the start of each push.
        pushed: 1 for the pushed disk, 0 for the other.
        heading: of the pusher on the table (rad).
    """
    place = jnp.sum(pushed[..., None] * state.position, axis=-2)
    turned = jnp.sum(pushed * state.angle, axis=-1)
    normal = direction(place - state.pusher_position)
    found = {
        "contact_angle": wrap_angle(heading - normal),
        **_vector("normal_on_disk", unit(normal - turned)),
        **_vector("place", place),
        **_vector("normal_on_table", unit(normal)),
        **_vector("disk_on_table", unit(turned)),
    }
    for body in range(scene.body_count):
        found[f"mass_{body + 1}"] = scene.mass[..., body]
        found[f"radius_{body + 1}"] = scene.radius[..., body]
    if scene.body_count > 1:
        other = jnp.sum((1 - pushed)[..., None] * state.position, axis=-2)
        line = rotate(other - place, -heading)
        found |= {"bearing": direction(line), "distance": norm(line)}
    return found


def _vector(name: str, value: Float[Array, "push 2"]) -> dict[str, Array]:
    return {f"{name}_x": value[..., 0], f"{name}_y": value[..., 1]}


class Process(eqx.Module):
    """Gaussian processes of the same inputs, one for each output, given pushes.

    Inputs are standardised. So are outputs: `mean` and `scale` are in metres or radians
    for each metre of the pusher's travel.
    """

    inputs: Float[Array, "push input"]  # of the pushes that it was fitted to
    amplitude: Float[Array, " output"]
    length: Float[Array, "output input"]  # scale of each input
    noise: Float[Array, " output"]  # variance
    # The inverse covariance times the outputs. In these and in `mean`, outputs are
    # multiplied by the share of them that is added.
    weights: Float[Array, "output push"]
    whitening: Float[Array, "output push push"]  # inverse Cholesky factor of it
    mean: Float[Array, " output"]
    scale: Float[Array, " output"]
    kernel: KernelName = eqx.field(static=True, default="matern-3/2")

    def __call__(
        self, inputs: Float[Array, "push input"]
    ) -> tuple[Float[Array, "push output"], Float[Array, "push output"]]:
        """Return the mean and the standard deviation of each output, with its noise."""
        means, deviations = [], []
        for output in range(self.mean.shape[0]):
            variance, length = self.amplitude[output] ** 2, self.length[output, None]
            near = correlation(self.kernel, self.inputs / length, inputs / length)
            across = variance * near
            known = jnp.sum(_dot(self.whitening[output], across) ** 2, axis=0)
            left = variance - known
            means.append(_dot(self.weights[output], across))
            deviations.append(jnp.sqrt(jnp.maximum(left, 0.0) + self.noise[output]))
        mean, deviation = jnp.stack(means, -1), jnp.stack(deviations, -1)
        return self.mean[None] + self.scale[None] * mean, self.scale[None] * deviation


def correlation(
    kernel: KernelName,
    one: Float[Array, "one input"],
    other: Float[Array, "other input"],
) -> Float[Array, "one other"]:
    """Return the prior correlation of points whose length scales are 1.

    One product of matrices gives all squared distances, in a quarter of the time of
    their differences.
    """
    sizes = jnp.sum(one**2, axis=1)[:, None] + jnp.sum(other**2, axis=1)[None]
    factor, of = KERNELS[kernel]
    squares = factor * (sizes - 2 * _dot(one, other.T))
    differ = squares > _SAME  # the root has no slope at zero
    far = jnp.where(differ, jnp.sqrt(jnp.where(differ, squares, 1.0)), 0.0)
    return of(far, jnp.exp)[0]


def error_near(errors: T, close: T) -> T:
    """Return the mean error near each push; the mean of all counts as one push more.

    Args:
        errors: ``[known]``, on known pushes.
        close: ``[known, push]``, from 0 to 1.
    """
    return cast(T, (errors @ close + errors.mean()) / (close.sum(axis=0) + 1))


class ResidualProcess(AbstractCorrector):
    """Adds a share of the expected residual to a simulator prediction."""

    process: Process
    centre: Float[Array, " input"]
    width: Float[Array, " input"]  # inputs are centred, then divided by it
    # Of position and rotation: errors on the pushes, each left out of a fit, in
    # standard deviations; and the length scales within which pushes are near.
    errors: Float[Array, "push body 2"]
    near: Float[Array, "body 2 input"]
    # Of 90 % regions of position and rotation: factors of the errors that are expected,
    # and sizes that are the same for all pushes (m, rad, for each metre of travel).
    reach: Float[Array, "body 2"]
    plain: Float[Array, "body 2"]
    inputs: Inputs
    time_step: float = eqx.field(static=True)

    @property
    def made_for(self) -> Purpose:
        """Pushes along paths, of as many disks as it was fitted to."""
        return Purpose("robot", self.time_step, self.reach.shape[0])

    @property
    def has_regions(self) -> bool:
        """True: a process predicts its own variance."""
        return True

    def correct(
        self,
        scene: Scene,
        start: Start,
        controls: Controls,
        simulated: Trajectory | None,
    ) -> Prediction:
        """Add the expected residual, which grows with the travel of the pusher."""
        assert simulated is not None
        assert start.simulated is not None
        states, before = simulated.states, start.predicted
        travel, heading = travel_of(controls, before)
        rate = self._rates(scene, start, heading)[0]
        moved = rate[:, None] * jnp.cumsum(travel, axis=1)[..., None, None]
        speed = rate[:, None] * (travel / scene.time_step)[..., None, None]
        turn = heading[:, None, None]
        already = before.position - start.simulated.position
        turned = before.angle - start.simulated.angle
        corrected = State(
            position=states.position + already[:, None] + rotate(moved[..., :2], turn),
            angle=states.angle + turned[:, None] + moved[..., 2],
            velocity=states.velocity + rotate(speed[..., :2], turn),
            spin=states.spin + speed[..., 2],
            pusher_position=states.pusher_position,
            pusher_velocity=states.pusher_velocity,
        )
        return Prediction(Trajectory(corrected))

    def region(self, scene: Scene, start: Start, controls: Controls) -> Region:
        """Return the regions about the predicted ends of pushes."""
        travel, heading = travel_of(controls, start.predicted)
        whole = travel.sum(axis=1)[:, None, None]
        grown = self._rates(scene, start, heading)[1] * whole
        reach = self.reach[None] * self.expected(self.inputs.of(scene, start, heading))
        return Region(
            heading=heading,
            axes=reach[..., :1] * grown[..., :2],
            turn=reach[..., 1] * grown[..., 2],
            plain=self.plain[None] * whole,
        )

    def expected(
        self, inputs: Float[Array, "push input"]
    ) -> Float[Array, "push body 2"]:
        """Return the error that is expected of each push, in standard deviations."""
        points = (inputs - self.centre[None]) / self.width[None]
        known, kernel = self.process.inputs, self.process.kernel
        lengths = self.near.reshape(-1, 1, known.shape[1])
        found = [
            error_near(errors, correlation(kernel, known / length, points / length))
            for errors, length in zip(
                self.errors.reshape(len(known), -1).T, lengths, strict=True
            )
        ]
        return jnp.stack(found, axis=-1).reshape(len(points), -1, 2)

    def rates(
        self, inputs: Float[Array, "push input"]
    ) -> tuple[Float[Array, "push output"], Float[Array, "push output"]]:
        """Return what is added per metre of travel (m, m, rad), and its deviation."""
        return self.process((inputs - self.centre[None]) / self.width[None])

    def _rates(
        self, scene: Scene, start: Start, heading: Float[Array, " push"]
    ) -> tuple[Float[Array, "push body 3"], Float[Array, "push body 3"]]:
        self.made_for.check_disks(scene.body_count)
        mean, deviation = self.rates(self.inputs.of(scene, start, heading))
        shape = (-1, scene.body_count, RESIDUALS)
        return mean.reshape(shape), deviation.reshape(shape)


def travel_of(
    controls: Controls, start: State
) -> tuple[Float[Array, "push time"], Float[Array, " push"]]:
    """Return the travel of the pusher in each step (m), and its heading (rad)."""
    path = controls.command
    whole = jnp.concatenate([start.pusher_position[:, None], path], axis=1)
    straight = path[:, -1] - start.pusher_position
    is_still = norm(straight) < _SMALLEST
    ahead = jnp.where(is_still[:, None], jnp.array([[1.0, 0.0]]), straight)
    return norm(whole[:, 1:] - whole[:, :-1]), direction(ahead)
