"""Train SAIN around an engine of your own, and plan with it: a step function."""

from dataclasses import replace

import jax.numpy as jnp

import sainet as sn


def step(scene: sn.Scene, state: sn.State) -> sn.State:
    """Carry disk 1 with the pusher; arrays have a leading axis, push."""
    is_pushed = (jnp.arange(state.body_count) == 0)[:, None]
    velocity = jnp.where(is_pushed, state.pusher_velocity[:, None], 0.0)
    position = state.position + scene.time_step * velocity
    return replace(state, position=position, velocity=velocity)


carrying = sn.from_step(step, name="carrying")
pushes = sn.generate(sn.GenerateConfig(pushes=40, chunk_size=40, hold_steps=32))
train, test = pushes.split(test=0.5)
network = sn.tune("sain", train, engine=carrying, iterations=10)
table = sn.evaluate({"physics": "physics", "own": carrying, "sain": network}, test)
print(table)
scene = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059])
task, planner = sn.PushToGoal([0.2, 0.05]), sn.make_planner("greedy")
print(planner.plan(network, task, scene, scene.in_a_row()).pushes[0])
