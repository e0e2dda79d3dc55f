"""Arguments of wrong types end in a line that names them.

In a process of its own: types are not checked there, as in the programs of users.
"""

import os
import subprocess
import sys

from support import SOURCE

PROGRAM = """
import sys
import gymnasium
import numpy as np
import sainet as sn

scene = sn.Scene.disks([0.9, 1.0], [0.054, 0.059])
state, planner = scene.in_a_row(), sn.make_planner("greedy")

def predicting(result):
    own = sn.from_function(lambda *given: result, name="own")
    return own.predict(scene, state, sn.Push(0.1), steps=3)

pushes = sn.open_pushes(sys.argv[1])
for call in (
    lambda: sn.evaluate(["physics"], pushes, steps=1.5),
    lambda: sn.evaluate(sn.load("physics"), pushes),
    lambda: sn.tune("foo", pushes),
    lambda: sn.tune("gp", pushes, features="bogus"),
    lambda: sn.tune("sain", pushes, iterations="3"),
    lambda: sn.tune("sain", pushes, iterations=1.5),
    lambda: sn.Recipe().changed(mirror="no").settings(),
    lambda: sn.cross_validate(pushes, models="foo"),
    lambda: pushes.split(test="a"),
    lambda: sn.load(None),
    lambda: sn.evaluate([3], pushes),
    lambda: sn.Push("left"),
    lambda: sn.PushToGoal({}),
    lambda: gymnasium.make_vec("sainet/PushDisks-v0", 2).reset(seed=1.5),
    lambda: sn.predict("sain", None, None, None),
    lambda: sn.evaluate(["physics"], None),
    lambda: sn.open_pushes(3),
    lambda: sn.generate(100),
    lambda: sn.GenerateConfig(noise="none"),
    lambda: sn.GenerateConfig(engine=None),
    lambda: sn.make_engine(None),
    lambda: pushes.take(1),
    lambda: pushes.take(None),
    lambda: predicting(np.zeros((1, 3, 2, 3), int)),
    lambda: predicting([[1], [1, 2]]),
    lambda: sn.from_function("own", name="own"),
    lambda: sn.from_step(None, name="own"),
    lambda: sn.make_planner("tree", deadline="a"),
    lambda: sn.make_planner("tree", deadline=-1.0),
    lambda: planner.plan("physics", [0.2, 0.05], scene, state),
    lambda: sn.run_episode(None, "greedy", "physics", None, scene),
    lambda: sn.tune("sain", "nowhere", iterations=np.int64(3)),
):
    try:
        call()
    except Exception as error:
        print(type(error).__name__, error)
"""
LINES = [
    "BadSetting `steps` is 1.5; it must be a whole number from 0 to 100000.",
    "BadInput `models` is '<Model physics: Physics>'; give a list, or a model for "
    "each name.",
    "BadSetting `model` is foo; it must be one of in, sain, gp.",
    "BadSetting `features` is bogus; it must be one of angle, side, place.",
    "BadSetting `iterations` is 3; it must be at least 1.",
    "BadInput recipe: iterations: expected `int`, got `float`.",
    "BadInput recipe: mirror: expected `bool`, got `str`.",
    "UnknownName No candidate named 'foo'. Available: gp-angle, gp-place, "
    "gp-place-chosen, gp-side, gp-side-chosen, sain, sain-ensemble, sain-place, "
    "sain-place-ensemble.",
    "BadSetting `test` is a; it must be above 0 and below 1.",
    "BadInput model is None; give a name, a folder or a model.",
    "BadInput model is 3; give a name, a folder or a model.",
    "BadScene push: contact_angle is left; give numbers.",
    "BadScene task: goal is {}; give numbers.",
    "BadSetting `seed` is 1.5; it must be a whole number from 0 to 4294967295.",
    "BadSetting `dynamics` is sain; it must be the field `dynamics` of a Model.",
    "BadSetting `pushes` is None; it must be a dataset, or its folder.",
    "BadSetting `pushes` is 3; it must be a dataset, or its folder.",
    "BadSetting `config` is 100; it must be a GenerateConfig.",
    "BadSetting `noise` is none; it must be a NoiseConfig.",
    "BadSetting `engine` is None; it must be one of bullet, planar.",
    "UnknownName No engine named 'None'. Available: bullet, planar.",
    "BadInput `rows` is 1; it must be whole numbers, the indices of pushes (of a mask, "
    "use `np.flatnonzero`).",
    "BadInput `rows` is None; it must be whole numbers, the indices of pushes (of a "
    "mask, use `np.flatnonzero`).",
    "BadInput own: its function returns numbers of the type int64; it must return "
    "floating-point numbers (m, m, rad).",
    "BadInput own: its function returns the shape []; it must be [1, 3, 2, 3]: push, "
    "time, body, pose (m, m, rad).",
    "BadSetting `function` is own; it must be a function.",
    "BadSetting `step` is None; it must be a function.",
    "BadSetting `deadline` is a; it must be a number of seconds.",
    "BadSetting `deadline` is -1.0; it must be a number of seconds.",
    "BadSetting `task` is [0.2, 0.05]; it must be a task, for example "
    "PushToGoal([0.2, 0.05]).",
    "BadSetting `planner` is greedy; it must be a planner, for example that of "
    "make_planner.",
    "BadStore nowhere: no such dataset; make one with 'sainet generate' or 'import'.",
]


def test_arguments_of_wrong_types_are_named(pushes):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(pushes.store.path)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": str(SOURCE.parent)},
    )
    assert done.stdout.splitlines() == LINES
