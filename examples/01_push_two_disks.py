"""Push a disk that pushes another, in all 72 directions of the paper's grid at once."""

import jax.numpy as jnp

import sainet as sn

# One scene: two steel disks on ABS, the second in front of the first.
scene = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059])
start = scene.in_a_row()

# An engine with the true properties, the paper's, which assumes fixed properties, and
# the network that corrects the latter.
for name in ("physics-true", "physics", "sain"):
    final = sn.load(name).predict(scene, start, sn.PushGrid().pushes()).final
    moved = 1000 * jnp.linalg.norm(final.position - start.position[None], axis=-1)
    print(f"{name}: disk 1 moves {moved[:, 0].mean():.1f} mm, ", end="")
    print(f"disk 2 from {moved[:, 1].min():.1f} to {moved[:, 1].max():.1f} mm")
