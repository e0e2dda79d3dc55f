"""Engines from MJCF files: MuJoCo simulates disks and a pusher."""

from collections.abc import Sequence
from functools import lru_cache, partial
from hashlib import sha256
from math import ceil
from os import PathLike
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from sainet.api.engines import AbstractPathEngine, own_model
from sainet.engines.simulator import UNIFORM_PRESSURE, OwnSpec
from sainet.models.model import Model
from sainet.runs.documents import checked
from sainet.runs.errors import BadInput, MissingExtra, shown
from sainet.scenes.controls import Controls
from sainet.scenes.scene import GRAVITY, Scene
from sainet.scenes.state import State, pack_motion, unpack_motion

# Joints of a disk: the first three are its pose; all six replace a free joint, with an
# angle that is never wrapped.
_JOINTS = ("slide x", "slide y", "hinge z", "slide z", "hinge x", "hinge y")
_SETTLED = 0.25  # s, until disks rest on the table
_ARMATURE = 1e3  # kg, so that contacts do not slow the pusher within a substep
_TABLE, _RIM = 1, 2  # bits: what touches the table, and what touches a rim
_KEPT = ("size", "pos", "quat", "condim", "solref", "solimp", "margin", "gap")
_DIGEST = 8  # characters that distinguish contents of a file
_CHANGE = 2e-4  # m, or of a friction: half the distance of finite differences


class Pucks:
    """MuJoCo models of one file, compiled for the properties of each push."""

    def __init__(self, path: Path) -> None:
        """Read the file.

        Raises:
            MissingExtra: MuJoCo is not installed.
            BadInput: the file cannot be used.
        """
        try:
            import mujoco
            from mujoco.batch import Batch
        except ImportError:
            raise MissingExtra(
                "`from_mjcf` needs MuJoCo: pip install 'sainet[mujoco]'."
            ) from None
        # MuJoCo's stubs leave its specifications open.
        self._mj, self._batch, self._path = mujoco, Batch, path
        shapes = mujoco.mjtGeom
        self._cylinder, self._capsule = shapes.mjGEOM_CYLINDER, shapes.mjGEOM_CAPSULE
        self._settled = lru_cache(1024)(self._settle)
        try:
            self._spec: Any = mujoco.MjSpec.from_file(str(path))
            self._adopt(self._spec.compile())
            self._spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            message = f"{path}: MuJoCo refuses it, correct it: {shown(error, 300)}"
            raise BadInput(message) from None

    def check(self, holds: object, message: str) -> None:
        """Raise `BadInput` with the file and a message unless a condition holds."""
        if not holds:
            raise BadInput(f"{self._path}: {message}.")

    def _adopt(self, model: Any) -> None:  # noqa: ANN401
        """Check the bodies, and give them joints whose coordinates are poses."""
        bodies = {body.name: body for body in self._spec.bodies}
        found = sum(name.startswith("disk") for name in bodies)
        self.disks = [f"disk{number + 1}" for number in range(found or 1)]
        for name in self.disks:
            self.check(name in bodies, f"no body '{name}'; count disks from 1 upwards")
            types = "".join(sorted(j.type.name[6] for j in bodies[name].joints))
            count = {"F": 6, "HSS": 3, "HSSS": 4}.get(types, 0)  # Free, Hinge, Slide
            self.check(
                count,
                f"joints of '{name}' do not fit; give it a freejoint, or slides along "
                "x and y (and z) and a hinge about z",
            )
            self.check(self._rim(bodies[name]), f"no cylinder in '{name}'; add a geom")
            self._join(bodies[name], _JOINTS[:count])
        pusher = bodies.get("pusher")
        self.check(
            pusher is not None and pusher.mocap,
            "no mocap body 'pusher'; add <body name='pusher' mocap='true'>",
        )
        # MuJoCo takes mocap bodies as at rest in contacts: they would not drag disks.
        pusher.mocap = False
        _weigh(pusher, 1.0, np.ones(3))
        self._join(pusher, _JOINTS[:2], armature=_ARMATURE)
        for key in list(self._spec.keys):  # of the joints before
            self._spec.delete(key)

    def _rim(self, body: Any) -> Any:  # noqa: ANN401
        """Return the widest cylinder of a disk."""
        rims = [geom for geom in body.geoms if geom.type == self._cylinder]
        return max(rims, key=lambda geom: geom.size[0], default=None)

    def _join(self, body: Any, joints: Sequence[str], armature: float = 0.0) -> None:  # noqa: ANN401
        for joint in list(body.joints):
            self._spec.delete(joint)
        for (kind, axis), place in zip(
            map(str.split, joints), [*body.pos[:2], 0, 0, 0, 0]
        ):
            body.add_joint(
                name=f"{body.name} {kind} {axis}",
                type=getattr(self._mj.mjtJoint, f"mjJNT_{kind.upper()}"),
                axis=[axis == each for each in "xyz"],
                ref=place,
                armature=armature,
            )

    def _settle(self, time_step: float, *values: float) -> tuple[Any, np.ndarray]:
        """Return the model of one push, and its coordinates when disks rest.

        Args:
            time_step: of the scene, s.
            values: mass (kg) and radius (m) of each disk; friction of table, disks and
                pusher; radius of the pusher (m).
        """
        count, spec = len(self.disks), self._spec.copy()
        table, disk, pusher, tip = values[2 * count :]
        spec.option.timestep = time_step / self.substeps(time_step)
        for geom in _touching(spec.worldbody, 0, _TABLE):
            geom.friction[0], geom.priority = table, 1
        for geom in _touching(spec.body("pusher"), _RIM, _RIM):
            geom.type = self._capsule if geom.type == self._cylinder else geom.type
            geom.size[0], geom.friction[0], geom.priority = tip, pusher, 2
        for name, mass, radius in zip(self.disks, values, values[count:]):
            body = spec.body(name)
            rim = self._rim(body)
            stretch = radius / rim.size[0]
            for geom in _touching(body, _TABLE, 0):
                geom.pos[:2] *= stretch
            rim.size[0] = radius
            body.add_geom(
                type=self._capsule,
                contype=_RIM,
                conaffinity=_RIM,
                friction=[disk, 0.0, 0.0],
                **{each: getattr(rim, each) for each in _KEPT},
            )
            tip_over = mass * (3 * radius**2 + (2 * rim.size[1]) ** 2) / 12
            _weigh(body, mass, [tip_over, tip_over, mass * radius**2 / 2])
            if len(body.joints) == 3:
                arms = (1.0, 1.0, UNIFORM_PRESSURE * radius)
                for joint, arm in zip(body.joints, arms):
                    joint.frictionloss = table * mass * GRAVITY * arm
        model = spec.compile()
        data = self._mj.MjData(model)
        self._mj.mj_step(model, data, nstep=round(_SETTLED / model.opt.timestep))
        return model, data.qpos.copy()

    def substeps(self, time_step: float) -> int:
        """Return the number of steps of MuJoCo in a step of the scene (s)."""
        return ceil(time_step / self._spec.option.timestep - 1e-9)

    def run(
        self, time_step: float, values: Array, motion: Array, path: Array
    ) -> np.ndarray:
        """Return the motion after each step, [push, time, body, 6].

        Args:
            time_step: of the scene, s.
            values: of each push, as in `_settle`, [push, value].
            motion: before the push, [push, body, 6] (m, m, rad and their rates).
            path: of the pusher, with its start, [push, time + 1, 2] (m).
        """
        values, motion, path = (
            np.asarray(x, np.float64) for x in (values, motion, path)
        )
        models, rest = zip(*(self._settled(time_step, *row) for row in values.tolist()))
        batch = self._batch(models[0], len(models))
        batch.set_models(models)
        place, speed = batch.bind("qpos"), batch.bind("qvel")
        disks = [
            [models[0].joint(f"{d} {j}").id for j in _JOINTS[:3]] for d in self.disks
        ]
        pusher = [models[0].joint(f"pusher {j}").id for j in _JOINTS[:2]]
        place[:] = rest
        place[:, disks], speed[:, disks] = np.split(motion, 2, -1)
        poses, substeps = [motion[..., :3]], self.substeps(time_step)
        for start, way in zip(
            path[:, :-1].swapaxes(0, 1), np.diff(path, axis=1).swapaxes(0, 1)
        ):
            for part in range(substeps):
                place[:, pusher] = start + part / substeps * way
                speed[:, pusher] = way / time_step
                batch.step()
            poses.append(place[:, disks])
        poses = np.stack(poses, 1)
        rates = np.diff(poses, axis=1) / time_step
        return np.concatenate([poses[:, 1:], rates], -1, dtype=np.float32)


def _touching(body: Any, contype: int, conaffinity: int) -> list[Any]:  # noqa: ANN401
    """Return the geoms of a body that touch others, with other bits."""
    geoms = [geom for geom in body.geoms if geom.contype or geom.conaffinity]
    for geom in geoms:
        geom.contype, geom.conaffinity = contype, conaffinity
    return geoms


def _weigh(body: Any, mass: float, inertia: Any) -> None:
    """Set mass (kg) and moments of inertia (kg m^2) of a body about its origin."""
    body.explicitinertial, body.mass, body.inertia = True, mass, inertia
    body.ipos, body.iquat = np.zeros(3), np.eye(4)[0]


@partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def _moved(pucks: Pucks, time_step: float, *arrays: Array) -> Array:
    """Return the motion from `Pucks.run`."""
    pushes, bodies, _ = arrays[1].shape
    shape = (pushes, arrays[2].shape[1] - 1, bodies, 6)
    return jax.pure_callback(
        partial(pucks.run, time_step),
        jax.ShapeDtypeStruct(shape, jnp.float32),
        *arrays,
        vmap_method="sequential",
    )


@_moved.defjvp
def _derivative(pucks, time_step, primals, tangents):
    """Return the motion and its derivative, by central differences."""
    motion = _moved(pucks, time_step, *primals)

    def along(*given: Array) -> np.ndarray:
        exact = [np.asarray(x, np.float64) for x in given]
        at, by = exact[: len(primals)], exact[len(primals) :]
        size = _CHANGE / max(*(np.abs(x).max() for x in by), 1e-30)

        def end(way: float) -> np.ndarray:
            moved = [x + way * change for x, change in zip(at, by, strict=True)]
            return pucks.run(time_step, *moved)

        return (end(size) - end(-size)) / np.float32(2 * size)

    shape = jax.ShapeDtypeStruct(motion.shape, motion.dtype)
    slope = jax.pure_callback(
        along, shape, *primals, *tangents, vmap_method="sequential"
    )
    return motion, slope


class MjcfEngine(AbstractPathEngine):
    """MuJoCo on the host, called from JAX; derivatives are finite differences."""

    pucks: Pucks = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def states(self, scene: Scene, initial: State, controls: Controls) -> State:
        """Return the states after each step, [push, time, ...].

        Raises:
            BadInput: the scene has another number of disks than the file.
        """
        count = scene.body_count
        self.pucks.check(
            count == len(self.pucks.disks),
            f"it has {len(self.pucks.disks)} disks and the scene {count}; give both as "
            "many",
        )
        frictions = (
            "table_friction",
            "disk_friction",
            "pusher_friction",
            "pusher_radius",
        )
        others = jnp.stack([getattr(scene, each) for each in frictions], -1)
        values = jnp.concatenate([scene.mass, scene.radius, others], -1)
        start = initial.pusher_position[:, None]
        path = jnp.concatenate([start, controls.command], 1)
        motion = _moved(self.pucks, scene.time_step, values, pack_motion(initial), path)
        speed = jnp.diff(path, axis=1) / scene.time_step
        return unpack_motion(motion, path[:, 1:], speed)


def from_mjcf(path: PathLike[str] | str, *, name: str | None = None) -> Model:
    """Return a model that simulates with MuJoCo, from an MJCF file."""
    file = Path(path)
    engine = Pucks(file)
    content = sha256(file.read_bytes()).hexdigest()[:_DIGEST]
    spec = checked(OwnSpec(name=f"{name or file.stem}-{content}"), "engine")
    return own_model(MjcfEngine(engine, spec.name), spec)
