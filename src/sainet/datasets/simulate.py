"""One chunk of simulated pushes: scenes, controls, ground truth and predictions."""

import numpy as np

from sainet.datasets.batch import check_finite, from_trajectory
from sainet.datasets.config import GenerateConfig
from sainet.datasets.schema import StoreInfo, simulated_name
from sainet.engines import make_engine
from sainet.engines.base import roll_out
from sainet.engines.simulator import simulator_named
from sainet.scenes.controls import Controls
from sainet.scenes.scene import TIME_STEP, Scene
from sainet.scenes.state import State, pack_motion
from sainet.worlds.config import bounds
from sainet.worlds.noise_config import at_level
from sainet.worlds.sampling import chunk_generator, draw
from sainet.worlds.setups import SETUPS, AbstractSetup
from sainet.worlds.world import SimulatedWorld


def store_info(config: GenerateConfig) -> StoreInfo:
    """Return the properties of the whole dataset."""
    stroke = np.array(bounds(config.stroke_mm)[1] / 1000)
    speed = np.array(bounds(config.speed_mm_s)[0] / 1000)
    longest = _setup(config).steps(stroke, speed)
    return StoreInfo(
        kind=config.setup,
        pushes=config.pushes,
        bodies=config.disks,
        steps=int(longest),
        chunk_size=config.chunk_size,
        time_step=TIME_STEP,
        engine=config.engine,
        assumed_engines=config.assumed_engine,
        has_measurements=True,
        seed=config.seed,
    )


def simulate_chunk(config: GenerateConfig, index: int) -> dict[str, np.ndarray]:
    """Return every array of one chunk of the dataset.

    The chunk depends only on the settings and its index, not on the process.

    Raises:
        Diverged: an engine predicted NaN or infinity.
    """
    info = store_info(config)
    part = info.chunk_slice(index)
    world = SimulatedWorld(
        make_engine(config.engine),
        _setup(config),
        at_level(config.noise, config.noise_level),
        chunk_generator(config.seed, index),
    )
    # Always a whole chunk, so that the last chunk needs no compilation of its own.
    draws = draw(config, world.rng, config.chunk_size)
    scene, push = draws.scene(), draws.push()
    initial, controls = world.setup.command(scene, draws.state(), push, info.steps)
    rough = world.roughen(scene)
    truth, pusher = from_trajectory(world.execute(rough, initial, controls))
    arrays = {
        **_scene_arrays(scene, initial, controls),
        "steps": world.setup.steps(draws.stroke, draws.speed),
        "group": np.zeros(config.chunk_size),
        "truth": truth,
        "truth_pusher": pusher,
        "pose_observed": np.ones(truth.shape[:2]),
        "rate_observed": np.ones(truth.shape[:2]),
    }
    for name in config.assumed_engine:
        engine = simulator_named(name).build()
        predicted = roll_out(engine, scene, initial, controls)
        arrays[simulated_name(name)] = from_trajectory(predicted)[0]
    arrays["measured"] = world.capture(truth[..., :3])
    arrays = {name: value[: part.stop - part.start] for name, value in arrays.items()}
    names = [f"push {number} of the dataset" for number in range(part.start, part.stop)]
    check_finite(config.engine, arrays["truth"], names)
    for name in config.assumed_engine:
        check_finite(name, arrays[simulated_name(name)], names)
    return arrays


def _setup(config: GenerateConfig) -> AbstractSetup:
    return SETUPS[config.setup](config)


def _scene_arrays(
    scene: Scene, initial: State, controls: Controls
) -> dict[str, np.ndarray]:
    names = ("mass", "radius", "table_friction", "disk_friction", "pusher_friction")
    arrays = {name: getattr(scene, name) for name in (*names, "pusher_radius")}
    arrays |= {"initial": pack_motion(initial)}
    arrays |= {"initial_pusher": initial.pusher_position, **controls.arrays()}
    return {name: np.asarray(value) for name, value in arrays.items()}
