"""Integrators: the next motion from the current one and a network's acceleration f."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.models.identity import IntegratorName
from sainet.models.inputs import Drive

RELAXATION_TIME = 0.1  # s


@dataclass(frozen=True)
class Integrator(ABC):
    """Turns accelerations into motion; its equation is that of `rate`."""

    name: ClassVar[IntegratorName]
    is_additive: ClassVar[bool] = False  # f is added to the motion of an engine

    def step(
        self,
        motion: Float[Array, "6 body push"],
        change: Float[Array, "3 body push"],
        drive: Drive,
        time_step: float,
    ) -> Float[Array, "6 body push"]:
        """Return the next packed motion, p' = p + dt v'.

        Args:
            motion: packed, in columns.
            change: f, in columns: m/s^2, m/s^2 and rad/s^2.
            drive: in columns.
            time_step: dt (s).
        """
        rate = self.rate(motion[3:6], drive, time_step) + time_step * change
        pose = motion[0:3] + time_step * rate
        return jnp.concatenate([pose, rate])

    @abstractmethod
    def rate(
        self, rate: Float[Array, "3 body push"], drive: Drive, time_step: float
    ) -> Float[Array, "3 body push"]:
        """Return the next velocity and spin where f is zero."""


@dataclass(frozen=True)
class Acceleration(Integrator):
    """The paper's form: v' = v + dt f (eq. 7 and 12)."""

    name: ClassVar[IntegratorName] = "acceleration"

    def rate(self, rate: Array, drive: Drive, time_step: float) -> Array:
        """Return v."""
        del drive, time_step
        return rate


class Gains(NamedTuple):
    """Deviations after each of some steps during which f stays the same."""

    rate_of_rate: Float[np.ndarray, " step"]
    rate_of_change: Float[np.ndarray, " step"]  # s
    pose_of_rate: Float[np.ndarray, " step"]  # s
    pose_of_change: Float[np.ndarray, " step"]  # s^2


@dataclass(frozen=True)
class RelaxingResidual(Integrator):
    """The form of additive networks: v' = vs' + a (v - vs) + dt f, a = exp(-dt / tau).

    vs is the simulated rate. Each step keeps a share of the deviation of the rate and
    adds f: with deviations e of the pose and d of the rate, d' = a d + dt f and
    e' = e + dt d'. Friction stops a pushed body as fast as that; otherwise f would add
    up for seconds.
    """

    name: ClassVar[IntegratorName] = "relaxing-residual"
    is_additive: ClassVar[bool] = True

    tau: float = RELAXATION_TIME  # s

    def rate(self, rate: Array, drive: Drive, time_step: float) -> Array:
        """Return vs' + a (v - vs)."""
        pose_step, rate_step = drive.simulated_pose_step, drive.simulated_rate_step
        if pose_step is None or rate_step is None:
            raise ValueError("an additive network needs the simulator prediction")
        simulated = pose_step / time_step  # over this step
        deviation = rate - (simulated - rate_step)
        return simulated + self.kept(time_step) * deviation

    def kept(self, time_step: float) -> float:
        """Return a, the share of the deviation that is left after a step (s)."""
        return math.exp(-time_step / self.tau)

    def gains(self, time_step: float, steps: int) -> Gains:
        """Return the gains of the deviation of the rate and of f."""
        left = self.kept(time_step) ** np.arange(1, steps + 1)
        added = time_step * np.cumsum(np.append(1.0, left[:-1]))
        return Gains(
            rate_of_rate=left,
            rate_of_change=added,
            pose_of_rate=time_step * np.cumsum(left),
            pose_of_change=time_step * np.cumsum(added),
        )


INTEGRATORS = {each.name: each for each in (Acceleration(), RelaxingResidual())}

# Typical sizes of x, y (m), angle (rad) and their rates, which make a gradient with
# respect to packed motion dimensionless.
GRADIENT_SIZES = (0.01, 0.01, 0.05, 0.03, 0.03, 0.2)
GRADIENT_BOUND = 5.0  # norm of a push's gradient in these sizes; typically about 1


@jax.custom_vjp
def bound_gradient(motion: Float[Array, "6 body push"]) -> Float[Array, "6 body push"]:
    """Return the motion, and bound the gradient of each push in the backward pass.

    The gradient of a diverging prediction grows with every step and would dominate its
    batch (Graves 2013 bounds recurrent gradients in the same way).
    """
    return motion


def _forward(motion: Array) -> tuple[Array, None]:
    return motion, None


def _backward(_: None, gradient: Array) -> tuple[Array]:
    sizes = jnp.array(GRADIENT_SIZES, gradient.dtype)[:, None, None]
    squared = jnp.sum((gradient * sizes) ** 2, axis=(0, 1), keepdims=True)
    # An overflow counts as zero: its direction is lost as well.
    share = jnp.minimum(
        1.0, GRADIENT_BOUND * jax.lax.rsqrt(jnp.maximum(squared, 1e-30))
    )
    usable = jnp.isfinite(squared) & jnp.isfinite(gradient)
    return (jnp.where(usable, gradient * share, 0.0),)


bound_gradient.defvjp(_forward, _backward)
