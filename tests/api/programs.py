"""The short programs of the documentation, as they are shown."""

PREDICT = """
import sainet as sn

model = sn.load("sain")  # or a folder: "runs/sain"
scene = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059])
trajectory = model.predict(scene, scene.in_a_row(), sn.Push(contact_angle=0.2))
print(trajectory.final.position)  # m, [disk, 2]
"""
OWN_DATA = """
import sainet as sn

train, test = sn.open_pushes("runs/recorded").split(test=0.2, seed=0)  # own data
fitted = sn.identify(train)
network = sn.tune("sain", train, engine=fitted)
models = {"physics-true": "physics-true", "fitted": fitted, "sain": network}
table = sn.evaluate({"physics": "physics", **models}, test)
print(table.verdict())
table.to_pandas()
table.save("report.html")
"""
CONTROL = """
import gymnasium

import sainet as sn

env = gymnasium.make("sainet/PushDisks-v0", goals="hard")
planner = sn.TreePlanner(sn.load("sain"), env.unwrapped.task)
observation, info = env.reset(seed=0)
done = False
while not done:
    action = planner.act(observation)
    observation, reward, terminated, truncated, info = env.step(action)
    done = terminated or truncated
"""
