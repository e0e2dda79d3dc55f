"""Engines from MJCF files: MuJoCo simulates disks and a pusher."""

import re
from collections.abc import Sequence
from functools import lru_cache
from hashlib import sha256
from math import ceil
from os import PathLike
from pathlib import Path

import equinox as eqx
import numpy as np
from jaxtyping import Array

from sainet.api.engines import AbstractHostEngine, Part, own_model, packed
from sainet.engines.simulator import OwnSpec
from sainet.models.model import Model
from sainet.runs.documents import checked
from sainet.runs.errors import BadInput, missing_extra, shown
from sainet.scenes.controls import Controls
from sainet.scenes.scene import Scene
from sainet.scenes.state import State

# Joints of a disk: the first three are its pose. All six replace a free joint; their
# angle is never wrapped.
_JOINTS = ("slide x", "slide y", "hinge z", "slide z", "hinge x", "hinge y")
_COUNTS = {"F": 6, "HSS": 4, "HSSS": 4}  # of them, by initials: free, hinge, slide
_REMEDY = "give it a freejoint, or slides along x and y (and z) and a hinge about z"
_TABLE, _RIM = 1, 2  # bits: what touches the table, and what touches a rim
_KEPT = ("size", "pos", "quat", "condim", "solref", "solimp", "margin", "gap")
_SETTLED = 0.1  # s, until disks rest on the table
_HEAVY = 1e3  # kg, so that contacts do not slow the pusher within a substep
_PROPERTIES = ("table_friction", "disk_friction", "pusher_friction", "pusher_radius")
_DIGEST = 8  # characters that distinguish contents of a file


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
            raise missing_extra("`from_mjcf` needs MuJoCo", "mujoco") from None
        mj: Part = mujoco
        self._path, self._mujoco, self._batch = path, mj, Batch
        self._cylinder = mj.mjtGeom.mjGEOM_CYLINDER
        self._capsule = mj.mjtGeom.mjGEOM_CAPSULE
        self._settled = lru_cache(1024)(self._settle)
        try:
            self._spec = mj.MjSpec.from_file(str(path))
            self._adopt()
            self._spec.compile()
        except (ValueError, mj.FatalError) as error:
            why = shown(" ".join(str(error).split()), 200)
            raise BadInput(f"{path}: MuJoCo refuses it ({why}); correct it.") from None

    def check(self, holds: object, message: str) -> None:
        """Raise `BadInput` with the file and a message unless a condition holds."""
        if not holds:
            raise BadInput(f"{self._path}: {message}.")

    def _adopt(self) -> None:
        """Check the bodies, and give them joints whose coordinates are poses."""
        model = self._spec.compile()
        bodies = {body.name: body for body in self._spec.bodies}
        pusher: Part = bodies.get("pusher")
        self.check(pusher and pusher.mocap, "no mocap body 'pusher'; add one")
        found = sum(re.fullmatch(r"disk\d+", name) is not None for name in bodies)
        self.disks = [f"disk{number + 1}" for number in range(found or 1)]
        for name in self.disks:
            self.check(name in bodies, f"no body '{name}'; use disk1, disk2, ...")
            disk = bodies[name]
            initials = "".join(sorted(joint.type.name[6] for joint in disk.joints))
            fits = initials in _COUNTS and disk.parent == self._spec.worldbody
            self.check(fits, f"joints of '{name}' do not fit; {_REMEDY}")
            self.check(self._rim(disk), f"no cylinder in '{name}'; add a geom")
            self._join(model, disk, _JOINTS[: _COUNTS[initials]])
        # MuJoCo takes mocap bodies as at rest in contacts: they would not drag disks.
        pusher.mocap, pusher.explicitinertial = False, True
        pusher.mass, pusher.inertia, pusher.ipos = _HEAVY, np.ones(3), np.zeros(3)
        self._join(model, pusher, _JOINTS[:2])
        for key in list(self._spec.keys):  # of the joints before
            self._spec.delete(key)

    def _rim(self, body: Part) -> Part:
        """Return the widest cylinder of a disk."""
        rims = [geom for geom in body.geoms if geom.type == self._cylinder]
        return max(rims, key=lambda geom: geom.size[0], default=None)

    def _join(self, model: Part, body: Part, joints: Sequence[str]) -> None:
        """Replace the joints of a body; x and y are coordinates of the table."""
        is_upright = abs(model.body(body.name).quat[0]) == 1
        self.check(is_upright, f"'{body.name}' is rotated; remove its rotation")
        for joint in list(body.joints):
            self._spec.delete(joint)
        for each in joints:
            kind, axis = each.split()
            sort = getattr(self._mujoco.mjtJoint, f"mjJNT_{kind.upper()}")
            joint = body.add_joint(name=f"{body.name} {each}", type=sort)
            joint.axis = [axis == other for other in "xyz"]
            joint.ref = body.pos["xy".index(axis)] if each in _JOINTS[:2] else 0.0

    def _settle(self, time_step: float, *values: float) -> tuple[Part, np.ndarray]:
        """Return the model of one push, and its coordinates when disks rest.

        Args:
            time_step: of the scene, s.
            values: mass (kg) and radius (m) of each disk, then friction of
                table, disks and pusher, and radius of the pusher (m).
        """
        count, spec = len(self.disks), self._spec.copy()
        table, between, pusher, tip = values[2 * count :]
        spec.option.timestep = time_step / ceil(time_step / spec.option.timestep - 1e-9)
        for geom in _touching(spec.worldbody, 0, _TABLE):
            geom.friction[0], geom.priority = table, 1
        for geom in _touching(spec.body("pusher"), _RIM, _RIM):
            geom.type = self._capsule if geom.type == self._cylinder else geom.type
            geom.size[0], geom.friction[0], geom.priority = tip, pusher, 2
        for name, mass, radius in zip(self.disks, values, values[count:], strict=False):
            self._set_disk(spec.body(name), mass, radius, between)
        model = spec.compile()
        data = self._mujoco.MjData(model)
        self._mujoco.mj_step(model, data, nstep=round(_SETTLED / model.opt.timestep))
        return model, data.qpos.copy()

    def _set_disk(self, body: Part, mass: float, radius: float, mu: float) -> None:
        """Give a disk its mass (kg), radius (m) and friction mu with others."""
        rim = self._rim(body)
        stretch = radius / rim.size[0]
        for geom in _touching(body, _TABLE, 0):
            geom.pos[:2] *= stretch
        rim.size[0] = radius
        # Contacts of capsules have exact normals, those of cylinders do not.
        capsule = body.add_geom(
            type=self._capsule, **{n: getattr(rim, n) for n in _KEPT}
        )
        capsule.contype = capsule.conaffinity = _RIM
        capsule.friction[0] = mu
        about_x = mass * (3 * radius**2 + (2 * rim.size[1]) ** 2) / 12
        body.explicitinertial, body.mass = True, mass
        body.inertia = about_x, about_x, mass * radius**2 / 2
        body.ipos, body.iquat = np.zeros(3), np.eye(4)[0]

    def run(self, time_step: float, *arrays: Array | np.ndarray) -> np.ndarray:
        """Return the motion after each step, [push, time, body, 6].

        Args:
            time_step: of the scene, s.
            arrays: values as in `_settle`, [push, value]; motion before the push,
                [push, body, 6] (m, m, rad and their rates); path of the pusher with
                its start, [push, time + 1, 2] (m).
        """
        values, motion, path = (np.asarray(each, np.float64) for each in arrays)
        settled = [self._settled(time_step, *row) for row in values.tolist()]
        models, rest = zip(*settled, strict=True)
        batch = self._batch(models[0], len(models))
        batch.set_models(models)
        place, speed = batch.bind("qpos"), batch.bind("qvel")
        joint, at, rate = models[0].joint, models[0].jnt_qposadr, models[0].jnt_dofadr
        disks = [[joint(f"{d} {each}").id for each in _JOINTS[:3]] for d in self.disks]
        pusher = [joint(f"pusher {each}").id for each in _JOINTS[:2]]
        substeps = round(time_step / models[0].opt.timestep)
        place[:] = rest
        place[:, at[disks]], speed[:, rate[disks]] = np.split(motion, 2, axis=-1)
        poses = [motion[..., :3]]
        for time in range(path.shape[1] - 1):
            start, way = path[:, time], path[:, time + 1] - path[:, time]
            for part in range(substeps):
                place[:, at[pusher]] = start + part / substeps * way
                speed[:, rate[pusher]] = way / time_step
                batch.step()
            poses.append(place[:, at[disks]])
        found = np.stack(poses, axis=1)
        rates = np.diff(found, axis=1) / time_step
        return np.concatenate([found[:, 1:], rates], axis=-1, dtype=np.float32)


def _touching(body: Part, contype: int, conaffinity: int) -> list[Part]:
    """Return the geoms of a body that touch others, with other bits."""
    geoms = [geom for geom in body.geoms if geom.contype or geom.conaffinity]
    for geom in geoms:
        geom.contype, geom.conaffinity = contype, conaffinity
    return geoms


class MjcfEngine(AbstractHostEngine):
    """MuJoCo, called from JAX; derivatives are finite differences."""

    name: str = eqx.field(static=True)
    pucks: Pucks = eqx.field(static=True)

    def states(self, scene: Scene, initial: State, controls: Controls) -> State:
        """Return the states after each step, [push, time, ...].

        Raises:
            BadInput: the scene has another number of disks than the file.
        """
        count, wanted = len(self.pucks.disks), scene.body_count
        what = f"it has {count} disks, the scene {wanted}; give both as many"
        self.pucks.check(count == wanted, what)
        return super().states(scene, initial, controls)

    def motion(self, scene: Scene, initial: State, path: np.ndarray) -> np.ndarray:
        """Return the motion after each step, [push, time, body, 6]."""
        others = np.stack([getattr(scene, name) for name in _PROPERTIES], axis=-1)
        values = np.concatenate([scene.mass, scene.radius, others], axis=-1)
        return self.pucks.run(scene.time_step, values, packed(initial), path)


def from_mjcf(path: PathLike[str] | str, *, name: str | None = None) -> Model:
    """Return a model that simulates with MuJoCo, in the bodies of an MJCF file.

    The model predicts and plans as every other; `tune(engine=...)` trains a network
    around it, and `identify(engine=...)` estimates the frictions of its scenes, with
    finite differences. It needs the extra `mujoco`.

    The worldbody of the file has bodies `disk1`, `disk2` and so on, one for each disk
    of a scene, and a mocap body `pusher`; none is rotated. A disk has a vertical
    cylinder, its rim, and a freejoint, or slides along x and y (and z) and a hinge
    about z: then it does not tilt. Disks rest on geoms of the worldbody. Other geoms of
    a disk, for example feet, move with its rim. Each push sets:

    - mass, moments of inertia (of a solid disk) and radii of disks, radius of the
      pusher (m, of a cylinder, capsule or sphere), poses and velocities;
    - sliding friction: geoms of the worldbody have the friction with the table, the
      pusher that with the pusher, rims that of two disks;
    - which geoms touch: disks the worldbody, rims each other and the pusher;
    - the time step: at most that of the file, a whole fraction of the scene's.

    Everything else is the file's: solver, cone, stiffness of contacts, gravity,
    thickness and feet. Rims and pusher touch as capsules, whose normals are exact. The
    pusher is driven along its path by two slides, because MuJoCo's mocap bodies have no
    velocity and would not drag disks. Damping of joints and keyframes are removed.

    Args:
        path: of the MJCF file.
        name: of the engine: letters, digits, "_", "." and "-"; None: the name of the
            file. A hash of the file is appended, so that a network that was trained
            around it is loaded only where `from_mjcf` was called with this name and the
            same content. Files that it includes are not hashed.

    Raises:
        MissingExtra: MuJoCo is not installed.
        BadInput: the file is missing or does not follow these conventions, or the name
            has other characters.
    """
    file = Path(path)
    if not file.is_file():
        raise BadInput(f"{file}: no such file; give the path of an MJCF file.")
    content = sha256(file.read_bytes()).hexdigest()[:_DIGEST]
    spec = checked(OwnSpec(name=f"{name or file.stem}-{content}"), "engine")
    return own_model(MjcfEngine(spec.name, Pucks(file)), spec)
