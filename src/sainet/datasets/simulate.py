"""One chunk of simulated pushes: scenes, controls, truth with noise, and s-bar."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from sainet.datasets.batch import check_finite, from_trajectory
from sainet.datasets.config import GenerateConfig, bounds
from sainet.datasets.sampling import Draws, chunk_generator, draw
from sainet.datasets.schema import StoreInfo, simulated_name
from sainet.engines import make_engine
from sainet.engines.base import AbstractEngine, roll_out
from sainet.engines.simulator import simulator_named
from sainet.scenes.controls import (
    Controls,
    ForceControls,
    PathControls,
)
from sainet.scenes.pushes import Push, command_force, command_path
from sainet.scenes.scene import TIME_STEP, FrictionField, Scene
from sainet.scenes.state import State, at_rest, pack_motion
from sainet.worlds.noise import (
    capture_error,
    force_error,
    friction_features,
    tracking_error,
)
from sainet.worlds.noise_config import NoiseConfig, at_level

_LENGTH_BUCKET = 40  # steps: pushes of nearly the same length share a compilation


def store_info(config: GenerateConfig) -> StoreInfo:
    """Return what the store of such a dataset has in common."""
    return StoreInfo(
        kind="robot" if config.setup == "robot" else "direct-force",
        pushes=config.pushes,
        bodies=config.disks,
        steps=int(_steps(config, *_longest(config))),
        chunk_size=config.chunk_size,
        time_step=TIME_STEP,
        engine=config.engine,
        assumed_engines=config.assumed_engine,
        has_measurements=True,
        seed=config.seed,
    )


def simulate_chunk(config: GenerateConfig, index: int) -> dict[str, np.ndarray]:
    """Return every array of one chunk of the store.

    The chunk depends on the settings and its index alone, never on who makes it.

    Raises:
        Diverged: an engine left the numbers.
    """
    info = store_info(config)
    part = info.chunk_slice(index)
    pushes = part.stop - part.start
    rng = chunk_generator(config.seed, index)
    # Always a whole chunk, so that the last one compiles nothing of its own.
    draws = draw(config, rng, config.chunk_size)
    scene, initial, controls, steps = _commands(config, info, draws)
    noise = at_level(config.noise, config.noise_level)
    world = _with_friction_field(scene, noise, rng)
    actual = _disturb(controls, noise, rng, scene.time_step)
    truth, pusher = _rollout(make_engine(config.engine), world, initial, actual)
    simulated = {
        simulated_name(name): _rollout(
            simulator_named(name).build(), scene, initial, controls
        )[0]
        for name in config.assumed_engine
    }
    pose = truth[..., :3]
    arrays = {
        **_scene_arrays(scene, initial, controls),
        "steps": steps,
        "group": np.zeros(config.chunk_size),
        "truth": truth,
        "truth_pusher": pusher,
        "measured": pose + capture_error(rng, pose.shape[:3], noise),
        "pose_observed": np.ones(pose.shape[:2]),
        "rate_observed": np.ones(pose.shape[:2]),
        **simulated,
    }
    arrays = {name: value[:pushes] for name, value in arrays.items()}
    names = [f"push {number} of the dataset" for number in range(part.start, part.stop)]
    check_finite(config.engine, arrays["truth"], names)
    for name in config.assumed_engine:
        check_finite(name, arrays[simulated_name(name)], names)
    return arrays


def _longest(config: GenerateConfig) -> tuple[float, float]:
    stroke, speed = bounds(config.stroke_mm)[1], bounds(config.speed_mm_s)[0]
    return stroke / 1000, speed / 1000


def _steps(
    config: GenerateConfig, stroke: np.ndarray | float, speed: np.ndarray | float
) -> np.ndarray:
    """Return how many steps a push lasts, rounded up to a whole bucket."""
    if config.setup == "direct-force":
        return np.full(np.shape(stroke), config.force_steps)
    # A hair less than exact: 48.0000001 steps of motion are 48.
    moving = np.ceil(np.asarray(stroke) / speed / TIME_STEP - 1e-6)
    whole = moving + config.hold_steps
    return np.asarray(np.ceil(whole / _LENGTH_BUCKET) * _LENGTH_BUCKET, int)


def _commands(
    config: GenerateConfig, info: StoreInfo, draws: Draws
) -> tuple[Scene, State, Controls, np.ndarray]:
    scene = _scene(config, draws)
    position = jnp.asarray(draws.position, jnp.float32)
    resting = at_rest(position, jnp.zeros_like(scene.mass), position[:, 0])
    push = Push(
        contact_angle=jnp.asarray(draws.contact_angle, jnp.float32),
        direction=jnp.asarray(draws.direction, jnp.float32),
        length=jnp.asarray(draws.stroke, jnp.float32),
        speed=jnp.asarray(draws.speed, jnp.float32),
    )
    gap = config.gap_mm / 1000
    if config.setup == "robot":
        initial, controls = command_path(
            scene, resting, push, steps=info.steps, gap=gap
        )
    else:
        initial, controls = command_force(
            scene, resting, push, force=config.force_n, steps=info.steps, gap=gap
        )
    return scene, initial, controls, _steps(config, draws.stroke, draws.speed)


def _scene(config: GenerateConfig, draws: Draws) -> Scene:
    contact = jnp.asarray(draws.contact_friction, jnp.float32)
    return Scene(
        mass=jnp.asarray(draws.mass, jnp.float32),
        radius=jnp.asarray(draws.radius, jnp.float32),
        table_friction=jnp.asarray(draws.table_friction, jnp.float32),
        disk_friction=contact,
        pusher_friction=contact,
        pusher_radius=jnp.full_like(contact, config.pusher_radius_mm / 1000),
        time_step=TIME_STEP,
    )


def _with_friction_field(
    scene: Scene, noise: NoiseConfig, rng: np.random.Generator
) -> Scene:
    if not noise.friction_fraction:
        return scene
    features = friction_features(rng, len(scene.table_friction), noise)
    field = FrictionField(
        **{k: jnp.asarray(v, jnp.float32) for k, v in features.items()}
    )
    return eqx.tree_at(
        lambda s: s.friction_field, scene, field, is_leaf=lambda x: x is None
    )


def _disturb(
    controls: Controls, noise: NoiseConfig, rng: np.random.Generator, time_step: float
) -> Controls:
    """Return what the pusher really does, or is given, of what was commanded."""
    if isinstance(controls, ForceControls):
        force = np.asarray(controls.force)
        error = force_error(rng, force, noise, time_step)
        return eqx.tree_at(
            lambda c: c.force, controls, jnp.asarray(force + error, jnp.float32)
        )
    assert isinstance(controls, PathControls)
    moving = np.abs(np.asarray(controls.velocity)).max(axis=-1) > 0
    error = tracking_error(rng, moving, noise, time_step)
    return PathControls(
        position=jnp.asarray(np.asarray(controls.position) + error, jnp.float32),
        velocity=controls.velocity,
    )


def _rollout(
    engine: AbstractEngine, scene: Scene, initial: State, controls: Controls
) -> tuple[np.ndarray, np.ndarray]:
    return from_trajectory(roll_out(engine, scene, initial, controls))


def _scene_arrays(
    scene: Scene, initial: State, controls: Controls
) -> dict[str, np.ndarray]:
    names = ("mass", "radius", "table_friction", "disk_friction", "pusher_friction")
    arrays = {name: getattr(scene, name) for name in (*names, "pusher_radius")}
    arrays |= {"initial": pack_motion(initial)}
    arrays |= {"initial_pusher": initial.pusher_position, **controls.arrays()}
    return {name: np.asarray(value) for name, value in arrays.items()}
