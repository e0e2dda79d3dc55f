"""Train SAIN around MuJoCo, from an MJCF file of two disks (extra `mujoco`)."""

from pathlib import Path

import sainet as sn

pucks = sn.from_mjcf(Path(__file__).with_name("pucks.xml"))
pushes = sn.generate(sn.GenerateConfig(pushes=40, chunk_size=40, hold_steps=32))
train, test = pushes.split(test=0.5)
network = sn.tune("sain", train, engine=pucks, iterations=10)
table = sn.evaluate({"physics": "physics", "mujoco": pucks, "sain": network}, test)
print(table)
