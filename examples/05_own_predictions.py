"""Compare predictions that were made elsewhere with SAIN: a file of poses."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import sainet as sn

pushes = sn.generate(sn.GenerateConfig(pushes=20, chunk_size=20, seed=1))
batch = pushes.batch()

# Somewhere else: predict that nothing moves, [push, time, body, 3] (m, m, rad).
start = np.asarray(batch.initial.position)
pose = np.zeros((len(pushes), batch.truth.shape[1], 2, 3))
pose[..., :2] = start[:, None]

with TemporaryDirectory() as folder:
    np.savez(Path(folder, "still.npz"), hash=pushes.hashes, pose=pose)
    still = sn.from_predictions(Path(folder, "still.npz"))
table = sn.evaluate({"physics": "physics", "still": still, "sain": "sain"}, pushes)
print(table)
