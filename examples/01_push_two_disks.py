"""Push a disk that pushes another, in all 72 directions of the paper's grid at once."""

import jax
import jax.numpy as jnp

from sainet import PlanarEngine, PushGrid, Scene
from sainet.engines.base import AssumedProperties
from sainet.models.dynamics import PhysicsDynamics, predict
from sainet.scenes.pushes import command_path
from sainet.scenes.state import at_rest

# One scene: two steel disks on ABS, the second in front of the first.
scene = Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059])
position = jnp.array([[0.0, 0.0], [0.113, 0.0]])

# The same scene 72 times, pushed in 72 ways.
pushes = PushGrid().pushes()
count = len(pushes.speed)
scenes, positions = jax.tree.map(
    lambda x: jnp.broadcast_to(x, (count, *x.shape)), (scene, position)
)
resting = at_rest(positions, jnp.zeros((count, 2)), positions[:, 0])
initial, controls = command_path(scenes, resting, pushes, steps=80)

# An engine with the true properties, and the paper's, which assumes fixed properties.
for name, engine in (
    ("true properties", PlanarEngine()),
    ("assumed properties", AssumedProperties(PlanarEngine())),
):
    final = predict(PhysicsDynamics(engine), scenes, initial, controls).final
    moved = 1000 * jnp.linalg.norm(final.position - positions, axis=-1)
    print(f"{name}: disk 1 moves {moved[:, 0].mean():.1f} mm, ", end="")
    print(f"disk 2 from {moved[:, 1].min():.1f} to {moved[:, 1].max():.1f} mm")
