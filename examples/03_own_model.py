"""Compare a model of your own with SAIN: disk 1 moves as the pusher does."""

from pathlib import Path
from tempfile import TemporaryDirectory

import jax.numpy as jnp

from sainet import (
    AbstractDynamics,
    GenerateConfig,
    Model,
    ModelId,
    PathControls,
    Scene,
    State,
    Trajectory,
    at_rest,
    evaluate,
    generate,
    load_model,
)


class Carried(AbstractDynamics):
    """Disk 1 keeps its distance to the pusher; no other disk moves."""

    def begin(self, scene: Scene, state: State) -> State:
        """Return what `advance` starts from: positions are [push, body, 2]."""
        return state

    def advance(
        self,
        scene: Scene,
        carry: State,
        controls: PathControls,
        simulated: Trajectory | None = None,
    ) -> tuple[State, Trajectory]:
        """Predict every step: time follows push, [push, time, body, 2]."""
        path = controls.position - carry.pusher_position[:, None]
        disk_1 = jnp.arange(carry.body_count) == 0
        position = carry.position[:, None] + path[:, :, None] * disk_1[:, None]
        angle = jnp.broadcast_to(carry.angle[:, None], position.shape[:-1])
        states = at_rest(position, angle, controls.position)
        return Trajectory(states).final, Trajectory(states)


own = Model(ModelId(kind="physics", name="carried"), Carried())
with TemporaryDirectory() as folder:
    settings = GenerateConfig(pushes=20, chunk_size=20, seed=1)
    pushes = generate(settings, Path(folder) / "pushes")
    measured = evaluate([own, load_model("sain")], pushes)
for model in measured.slugs:
    error = measured.values("pos_mm", model).mean(axis=0)  # [push, body]
    print(
        f"{model}: "
        + ", ".join(f"disk {i}: {e:.2f} mm" for i, e in enumerate(error, 1))
    )
