"""The simulated world: executes pushes with noise and measures poses."""

import math
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from sainet.engines.base import AbstractEngine, roll_out
from sainet.scenes.controls import Controls
from sainet.scenes.scene import FrictionField, Scene
from sainet.scenes.state import State, Trajectory
from sainet.worlds.noise import NoiseConfig, capture_error, friction_features
from sainet.worlds.setups import AbstractSetup


@dataclass(frozen=True)
class SimulatedWorld:
    """An engine with noise: on the table, the commands and the measured poses.

    Each method draws from the generator, so the order of calls decides the noise.

    Attributes:
        engine: simulates the true motion.
        setup: how the pusher is driven.
        noise: on the table, the commands and the measured poses.
        rng: draws the noise.
        precision: in which errors are added.
    """

    engine: AbstractEngine
    setup: AbstractSetup
    noise: NoiseConfig
    rng: np.random.Generator
    precision: type[np.floating] = np.float64

    def roughen(self, scene: Scene) -> Scene:
        """Return the scene with a random friction field, if noise has one."""
        if not self.noise.friction_fraction:
            return scene
        batch = scene.batch_shape
        features = friction_features(self.rng, math.prod(batch), self.noise)
        shaped = {
            name: jnp.asarray(x.reshape((*batch, *x.shape[1:])), jnp.float32)
            for name, x in features.items()
        }
        return replace(scene, friction_field=FrictionField(**shaped))

    def execute(self, scene: Scene, initial: State, controls: Controls) -> Trajectory:
        """Return the states after each step of the controls with their errors.

        Args:
            scene: a batch of scenes, as `roughen` returns them.
            initial: of each push.
            controls: the commands, of this world's setup.
        """
        error = self.setup.error(controls, self.noise, self.rng, scene.time_step)
        command = np.asarray(controls.command) + error.astype(self.precision)
        executed = controls.with_command(jnp.asarray(command, jnp.float32))
        return roll_out(self.engine, scene, initial, executed)

    def capture(
        self, poses: Float[np.ndarray, "push time body 3"]
    ) -> Float[np.ndarray, "push time body 3"]:
        """Return measured poses (m, m, rad).

        Args:
            poses: true poses (m, m, rad).
        """
        error = capture_error(self.rng, poses.shape[:3], self.noise)
        return poses + error.astype(self.precision)
