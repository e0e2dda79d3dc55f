"""Engines of a user's own: a step function becomes a simulator."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array

from sainet.engines.base import AbstractEngine, AssumedProperties
from sainet.engines.simulator import OWN, InternalEngine, OwnSpec
from sainet.models.dynamics import PhysicsDynamics
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.models.push_inputs import is_traced
from sainet.runs.documents import checked
from sainet.runs.errors import BadInput, require
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory, unpack_motion

Step = Callable[[Scene, State], State]
Run = Callable[..., np.ndarray]  # of pushes, on the host
Part = Any  # an array of JAX or NumPy, or a part of a model of MuJoCo
_DISKS = ("position", "angle", "velocity", "spin")
_CHANGE = 2e-4  # m, or of a friction: half the distance of finite differences


class AbstractPathEngine(AbstractEngine):
    """An engine of a user's own; the pusher follows its path."""

    name: eqx.AbstractVar[str]

    @abstractmethod
    def states(self, scene: Scene, initial: State, controls: Controls) -> State:
        """Return the states after each step, [push, time, ...]."""

    def rollout(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Return the states after each step of the controls.

        Raises:
            BadInput: a force drives the pusher, or the engine does not accept the
                scene.
        """
        if controls.pusher_path is None:
            raise BadInput(
                f"engine '{self.name}': a force drives the pusher; engines of your own "
                "take pushers that follow a path."
            )
        shape = scene.batch_shape
        axes = len(shape)

        def flat(x: Array) -> Array:
            return x.reshape(-1, *x.shape[axes:])

        found = self.states(*jax.tree.map(flat, (scene, initial, controls)))
        return Trajectory(
            jax.tree.map(lambda x: x.reshape(*shape, *x.shape[1:]), found)
        )


class AbstractHostEngine(AbstractPathEngine):
    """An engine on NumPy arrays; JAX calls it, with finite differences as slopes."""

    @abstractmethod
    def motion(self, scene: Scene, initial: State, path: np.ndarray) -> np.ndarray:
        """Return the motion after each step, [push, time, body, 6].

        Args:
            scene: of each push; here all arrays are NumPy's.
            initial: state before each push.
            path: of the pusher with its start, [push, time + 1, 2] (m).
        """

    def states(self, scene: Scene, initial: State, controls: Controls) -> State:
        """Return the states after each step, [push, time, ...]."""
        start = initial.pusher_position[:, None]
        path = jnp.concatenate([start, controls.command], axis=1)
        given, form = jax.tree.flatten((scene, initial, path))
        (pushes, bodies), steps = scene.mass.shape, controls.steps

        def run(*arrays: Part) -> np.ndarray:
            return self.motion(*jax.tree.unflatten(form, map(np.asarray, arrays)))

        # Outside JAX's callbacks, errors of a user's function stay as they are.
        if self.on_host and not is_traced(given):
            motion = jnp.asarray(run(*given))
        else:
            motion = _motion(run, (pushes, steps, bodies, 6), *given)
        speed = jnp.diff(path, axis=1) / scene.time_step
        return unpack_motion(motion, path[:, 1:], speed)


def _called(run: Run, shape: tuple[int, ...], *arrays: Part) -> Array:
    """Return what a function returns on the host."""
    kind = jax.ShapeDtypeStruct(shape, jnp.float32)
    return jax.pure_callback(run, kind, *arrays, vmap_method="sequential")


@partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def _motion(run: Run, shape: tuple[int, ...], *arrays: Array) -> Array:
    """Return the motion from `AbstractHostEngine.motion`."""
    return _called(run, shape, *arrays)


@_motion.defjvp
def _slope(
    run: Run, shape: tuple[int, ...], at: Sequence[Array], by: Sequence[Array]
) -> tuple[Array, Array]:
    """Return the motion and its derivative, from central differences."""

    def along(*pairs: tuple[Array, Array]) -> np.ndarray:
        exact = [np.asarray(pair, np.float64) for pair in pairs]
        size = _CHANGE / max(*(np.abs(change).max() for _, change in exact), 1e-30)
        ends = [run(*(x + way * dx for x, dx in exact)) for way in (size, -size)]
        return (ends[0] - ends[1]) / np.float32(2 * size)

    pairs = zip(at, by, strict=True)
    return _motion(run, shape, *at), _called(along, shape, *pairs)


def packed(state: State) -> np.ndarray:
    """Return the motion of a state of NumPy arrays, as `pack_motion` does of JAX's."""
    rates = state.velocity, state.spin[..., None]
    return np.concatenate([state.position, state.angle[..., None], *rates], axis=-1)


class AbstractStepEngine(AbstractPathEngine):
    """An engine that repeats a step function."""

    step: eqx.AbstractVar[Step]

    def after(self, scene: Scene, state: State, path: Any) -> State:  # noqa: ANN401
        """Return the state one step later.

        Args:
            scene: of each push.
            state: of each push, before the step.
            path: position of the pusher at the end of the step, [push, 2] (m).

        Raises:
            BadInput: the step function returns arrays of another shape.
        """
        velocity = (path - state.pusher_position) / scene.time_step
        driven = eqx.tree_at(lambda s: s.pusher_velocity, state, velocity)
        found = self.step(scene, driven)
        if not isinstance(found, State):  # pyright: ignore[reportUnnecessaryIsInstance]
            kind = type(found).__name__
            raise BadInput(
                f"engine '{self.name}': its step returns a {kind}; it must be a State."
            )
        moved: list[Any] = []
        for name in _DISKS:
            value, before = getattr(found, name), getattr(state, name)
            if np.shape(value) != before.shape:
                raise BadInput(
                    f"engine '{self.name}': its step returns {name} of the shape "
                    f"{list(np.shape(value))}; it must be {list(before.shape)}."
                )
            moved.append(value.astype(before.dtype))
        return eqx.tree_at(_fields, driven, [*moved, path])


def _fields(state: State) -> list[Any]:
    return [*(getattr(state, name) for name in _DISKS), state.pusher_position]


class StepEngine(AbstractStepEngine):
    """A step function in JAX: compiled, and differentiable as far as it is."""

    step: Step
    name: str = eqx.field(static=True)

    def states(self, scene: Scene, initial: State, controls: Controls) -> State:
        """Return the states after each step, [push, time, ...]."""

        def advance(state: State, path: Array) -> tuple[State, State]:
            after = self.after(scene, state, path)
            return after, after

        path = jnp.moveaxis(controls.command, 1, 0)
        states = lax.scan(advance, initial, path)[1]
        return jax.tree.map(lambda x: jnp.moveaxis(x, 0, 1), states)


class HostStepEngine(AbstractHostEngine, AbstractStepEngine):
    """A step function on NumPy arrays: not compiled."""

    step: Step
    name: str = eqx.field(static=True)

    @property
    def on_host(self) -> bool:
        """True: it runs outside JAX."""
        return True

    def motion(self, scene: Scene, initial: State, path: np.ndarray) -> np.ndarray:
        """Return the motion after each step, [push, time, body, 6]."""
        state, found = initial, list[np.ndarray]()
        for time in range(1, path.shape[1]):
            state = self.after(scene, state, path[:, time])
            found.append(packed(state))
        return np.stack(found, axis=1, dtype=np.float32)


def from_step(step: Step, *, name: str, numpy: bool = False, version: int = 1) -> Model:
    """Return a model that simulates with an engine of your own.

    The model predicts and plans as every other; `tune(engine=...)` trains a network
    around it, and `identify(engine=...)` estimates the frictions of its scenes.

    Example: disk 1 is carried by the pusher, friction stops nothing::

        def step(scene, state):
            carried = (jnp.arange(state.body_count) == 0)[:, None]
            velocity = jnp.where(carried, state.pusher_velocity[:, None], 0.0)
            position = state.position + scene.time_step * velocity
            return replace(state, position=position, velocity=velocity)

        carrying = sn.from_step(step, name="carrying")

    Args:
        step: `step(scene, state)` returns the state one step later. All arrays have a
            leading axis, push: `scene.mass` [push, body] (kg), `state.position`
            [push, body, 2] (m), `state.angle` [push, body] (rad), `state.velocity`
            [push, body, 2] (m/s), `state.spin` [push, body] (rad/s). The pusher starts
            at `state.pusher_position` [push, 2] (m) and moves with
            `state.pusher_velocity` (m/s) during the step; where it is afterwards is
            filled in. `scene.time_step` is the step in seconds. `dataclasses.replace`
            of the state, or `jax.vmap` of a function for one push, is the short way.
            Velocities fit the poses: p(t+1) = p(t) + dt * v(t+1).
        name: of the engine: letters, digits, "_", "." and "-". A network that was
            trained around it is loaded where an engine of this name was made before.
        numpy: the function takes NumPy arrays; then it is not compiled, `identify`
            takes finite differences, and `jax.vmap` does not apply to the model.
        version: of the equations; a folder of an older version is not continued.

    Raises:
        BadInput: the name has other characters.
    """
    require(callable(step), "step", "a function", step)
    spec = checked(OwnSpec(name=name, version=version), "engine")
    kind = HostStepEngine if numpy else StepEngine
    return own_model(kind(step=step, name=name), spec)


def own_model(engine: AbstractPathEngine, spec: OwnSpec) -> Model:
    """Register an engine, and return the model that simulates with it."""
    OWN[spec.name] = engine
    identity = ModelId(kind="physics", simulator=spec, name=spec.name)
    return Model(identity, PhysicsDynamics(spec.build()), internal=InternalEngine(spec))


def register(model: Model) -> None:
    """Give the engine of a model its name again, if it is a user's own.

    Another one of that name may have been made since; it loses the name.
    """
    match model:
        case Model(
            id=ModelId(simulator=OwnSpec(name=name)),
            dynamics=PhysicsDynamics(engine=AssumedProperties(engine=engine)),
        ):
            OWN[name] = engine
        case _:
            pass
