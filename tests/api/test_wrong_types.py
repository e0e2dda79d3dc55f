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
import sainet as sn

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
