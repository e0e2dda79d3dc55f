"""Adaptation: properties of disks estimated from the pushes of an episode.

The estimate is the most probable one, given the pushes so far and a normal prior about
the given properties, on the logarithms. Properties that slow pushing cannot separate
stay as they were given: the mass of disk 1 and the friction of the table. Only their
ratios to other masses and frictions have an effect. Gauss-Newton steps minimise the
prediction errors of the planar engine, as in `identify`.
"""

from collections import deque
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from sainet.datasets.recorded.checks import clock_problems
from sainet.datasets.recorded.resample import ResampledPush, resample
from sainet.engines.base import AssumedProperties
from sainet.engines.planar.engine import PlanarEngine
from sainet.engines.simulator import UNIFORM_PRESSURE, Assumptions, PlanarSpec
from sainet.models.dynamics import AbstractDynamics, PhysicsDynamics
from sainet.models.model import Model
from sainet.models.wrappers import with_camera
from sainet.runs.errors import BadInput
from sainet.scenes.controls import PathControls
from sainet.scenes.pushes import Push, settled_steps
from sainet.scenes.recording import AGREES, CameraOffset, Recording
from sainet.scenes.scene import TIME_STEP, Scene, pair_gaps
from sainet.scenes.state import State, at_rest, pack_motion

REMEMBERED = 24  # pushes: older ones are forgotten, because surfaces change
_UNKNOWN = 80  # steps after which everything rests, of an unknown push
_BRAKING = 16  # steps, at least, that disks slide after the pusher has stopped
_STILL = 5e-4  # m, from its end: the pusher has stopped
_BUCKET = 80  # steps: arrays are a multiple, so that few sizes are compiled
# Standard deviations of the prior, of logarithms.
PRIOR = {"radius": 0.08, "mass": 0.1, "friction": 0.4, "pressure": 0.2}
# Of the errors of the engine with true properties at the end of a push.
ERROR_M, ERROR_RAD = 0.7e-3, np.deg2rad(1.0)
OVERLAP_M = 0.2e-3  # of disks, as measured
_STEPS = 4  # of Gauss-Newton
_LONGEST = 0.2  # of a step, in each logarithm


class Properties(NamedTuple):
    """Logarithms of properties over the given ones."""

    radius: Float[Array, " body"]
    mass: Float[Array, " other"]  # of the disks after the first, over disk 1
    friction: Float[Array, "2"]  # of the pusher, and between disks
    pressure: Float[Array, ""]  # radius ratio

    @staticmethod
    def none(bodies: int) -> "Properties":
        """Return the given properties themselves."""
        zeros = jnp.zeros
        return Properties(zeros(bodies), zeros(bodies - 1), zeros(2), zeros(()))

    def scene(self, given: Scene) -> Scene:
        """Return the scene with these properties."""
        mass = jnp.concatenate([jnp.zeros(1), self.mass])
        factor = jnp.exp(self.friction)
        return eqx.tree_at(
            lambda s: (s.radius, s.mass, s.pusher_friction, s.disk_friction),
            given,
            (
                given.radius * jnp.exp(self.radius),
                given.mass * jnp.exp(mass),
                given.pusher_friction * factor[0],
                given.disk_friction * factor[1],
            ),
        )

    def engine(self, ratio: Float[Array, ""]) -> PlanarEngine:
        """Return the engine whose pressure has this radius ratio, times the factor."""
        return PlanarEngine(pressure_radius_ratio=ratio * jnp.exp(self.pressure))


class _Pushes(NamedTuple):
    """The pushes that are remembered; filled up with some that touch no disk."""

    start: Float[Array, "push body 3"]  # m, m, rad
    pusher: Float[Array, "push 2"]  # m
    path: Float[Array, "push time 2"]  # m
    end: Float[Array, "push body 3"]


class _Given(NamedTuple):
    """What the estimate starts from."""

    scene: Scene
    ratio: Float[Array, ""]


class _Settled(NamedTuple):
    """A push, and the steps after which everything rests."""

    push: ResampledPush
    steps: int

    def end(self) -> Float[np.ndarray, "body 3"]:
        """Return the mean of the poses at rest, or else the last known pose."""
        pose = self.push.motion[..., :3]
        known = pose[np.isfinite(pose).all(axis=(1, 2))]
        settled = pose[self.steps :]
        settled = settled[np.isfinite(settled).all(axis=(1, 2))]
        return settled.mean(axis=0) if len(settled) else known[-1]

    def path(self, steps: int) -> Float[np.ndarray, "step 2"]:
        """Return the path until everything rests; the pusher then holds still."""
        last = min(self.steps, len(self.push.pusher)) - 1
        return self.push.pusher[np.minimum(np.arange(steps), last)]


def _settled(push: ResampledPush, sent: Push | None) -> _Settled:
    """Return a push with the steps of the command, or more where it began late.

    A physical robot begins to move before the contact, and follows with a delay.
    """
    steps = settled_steps(sent, TIME_STEP) if sent else _UNKNOWN
    away = np.linalg.norm(push.pusher - push.pusher[-1], axis=-1)
    stopped = int(np.flatnonzero(away > _STILL).max(initial=-1)) + 2
    return _Settled(push, max(steps, stopped + _BRAKING))


def check_adapts(model: Model) -> None:
    """Raise `BadInput` if a model is physics without the planar engine."""
    simulator = model.internal and model.internal.simulator
    if model.card is None and not isinstance(simulator, PlanarSpec):
        raise BadInput(
            "`adapt` uses the derivatives of the planar engine, which "
            f"{model.name} does not have; plan with physics, physics-true or a network."
        )


@dataclass
class Adaptation:
    """Estimates properties from push to push; `adapted` returns model and scene.

    Physics predicts with the estimated properties and is no longer bound to assumed
    ones. A network is given them as inputs; its internal engine stays as it is.

    Attributes:
        model: that plans.
        scene: one scene, with the properties given at first.
    """

    model: Model
    scene: Scene
    _pushes: "deque[_Settled]" = field(default_factory=lambda: deque(maxlen=REMEMBERED))

    def __post_init__(self) -> None:
        """Find what the engine assumes.

        Raises:
            BadInput: the model is physics without the planar engine.
        """
        check_adapts(self.model)
        internal = self.model.internal
        spec = internal.simulator if internal else None
        is_learned = self.model.card is not None
        ratio, scene = UNIFORM_PRESSURE, self.scene
        if isinstance(spec, PlanarSpec) and not is_learned:
            ratio, scene = spec.pressure_radius_ratio, spec.build().assume(scene)
        # Recordings are resampled at this time step, whatever that of the scene.
        scene = replace(scene, time_step=TIME_STEP)
        self._given = _Given(scene, jnp.float32(ratio))
        self._is_learned = is_learned
        self.found = Properties.none(scene.body_count)

    def add(self, recording: Recording) -> None:
        """Remember a push; one whose end is unknown is left out.

        Args:
            recording: of an executed push (s, m, rad).
        """
        if recording.trouble or any(clock_problems(recording)):
            return
        push = resample(recording)
        if np.isfinite(push.motion[..., :3]).all(axis=(1, 2)).any():
            self._pushes.append(_settled(push, recording.commanded))

    def adapted(self, state: State) -> tuple[AbstractDynamics, Scene]:
        """Return model and scene with the properties estimated from the pushes so far.

        Args:
            state: observed before the next push. Where two disks overlap in it, the
                estimated radii are reduced.
        """
        seen = jnp.asarray(pack_motion(state)[None, :, :3], jnp.float32)
        self.found = _most_probable(self.found, self._given, self._remembered(), seen)
        scene = self.found.scene(self._given.scene)
        scene = replace(scene, time_step=self.scene.time_step)
        if self._is_learned:
            return self.model.dynamics, scene
        engine = AssumedProperties(self.found.engine(self._given.ratio), Assumptions())
        return with_camera(PhysicsDynamics(engine), self._camera), scene

    @property
    def _camera(self) -> CameraOffset:
        internal = self.model.internal
        return internal.camera if internal else AGREES

    def _remembered(self) -> _Pushes:
        """Return the pushes, all in the coordinates of the camera."""
        offset = np.array(self._camera.vector)
        apart = _apart(self._given.scene.body_count)
        start, end = np.broadcast_to(apart, (2, REMEMBERED, *apart.shape)).copy()
        pusher = np.full((REMEMBERED, 2), -1.0)
        longest = max((each.steps for each in self._pushes), default=_BUCKET)
        steps = -(-longest // _BUCKET) * _BUCKET
        path = np.full((REMEMBERED, steps, 2), -1.0)
        for row, each in enumerate(self._pushes):
            push = each.push
            start[row], pusher[row] = push.initial, push.initial_pusher + offset
            path[row], end[row] = each.path(steps) + offset, each.end()
        arrays = (start, pusher, path, end)
        return _Pushes(*(jnp.asarray(each, jnp.float32) for each in arrays))


def _apart(bodies: int) -> Float[np.ndarray, "body 3"]:
    """Return poses of disks that nothing touches."""
    return np.stack([np.arange(bodies), np.zeros(bodies), np.zeros(bodies)], axis=-1)


@eqx.filter_jit
def _most_probable(
    begin: Properties, given: _Given, pushes: _Pushes, seen: Float[Array, "1 body 3"]
) -> Properties:
    """Return the most probable properties: damped Gauss-Newton steps."""
    vector, to_properties = ravel_pytree(begin)
    widths = Properties(
        *(jnp.full_like(part, PRIOR[name]) for name, part in begin._asdict().items())
    )
    precision = 1 / ravel_pytree(widths)[0] ** 2

    def errors(at: Array) -> Array:
        return _errors(to_properties(at), given, pushes, seen)

    def cost(at: Array) -> Array:
        robust = jnp.sum(2 * (jnp.sqrt(1 + errors(at) ** 2) - 1))
        return robust + jnp.sum(precision * at**2)

    def step(number: Array, at: Array) -> Array:
        del number
        error, slope = errors(at), jax.jacfwd(errors)(at)
        weight = 1 / jnp.sqrt(1 + error**2)  # of the soft l1 loss
        matrix = (slope * weight[:, None]).T @ slope + jnp.diag(precision)
        change = -jnp.linalg.solve(matrix, slope.T @ (weight * error) + precision * at)
        change = jnp.clip(change, -_LONGEST, _LONGEST)
        tried = jnp.stack([at, at + change / 4, at + change])
        return tried[jnp.argmin(jnp.nan_to_num(jax.vmap(cost)(tried), nan=jnp.inf))]

    return to_properties(lax.fori_loop(0, _STEPS, step, vector))


def _errors(
    found: Properties, given: _Given, pushes: _Pushes, seen: Float[Array, "1 body 3"]
) -> Float[Array, " number"]:
    """Return errors at the ends of pushes, and overlaps, over their deviations."""
    scene, count = found.scene(given.scene), len(pushes.start)
    scenes = jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *x.shape)), scene)
    start = at_rest(pushes.start[..., :2], pushes.start[..., 2], pushes.pusher)
    before = jnp.concatenate([pushes.pusher[:, None], pushes.path[:, :-1]], axis=1)
    controls = PathControls(pushes.path, (pushes.path - before) / scene.time_step)
    end = found.engine(given.ratio).rollout(scenes, start, controls).final
    away = (end.position - pushes.end[..., :2]) / ERROR_M
    turned = jnp.mod(end.angle - pushes.end[..., 2] + jnp.pi, 2 * jnp.pi) - jnp.pi
    missed = jnp.concatenate([away, turned[..., None] / ERROR_RAD], axis=-1)
    poses = jnp.concatenate([pushes.start, seen])
    states = at_rest(
        poses[..., :2], poses[..., 2], jnp.full_like(poses[:, 0, :2], -1.0)
    )
    gaps = jax.vmap(lambda each: pair_gaps(scene, each))(states)
    overlap = jnp.maximum(-gaps, 0.0) / OVERLAP_M
    return jnp.concatenate([missed.ravel(), overlap.ravel()])
