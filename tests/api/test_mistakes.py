"""What a newcomer types wrongly is answered in one sentence.

In processes of their own, because tests check types before our checks.
"""

import subprocess
import sys

import pytest

START = """
from dataclasses import replace

import numpy as np

import sainet as sn
still = np.zeros((4, 2), np.float32)
scene = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059])
state, push = scene.in_a_row(), sn.Push(0.2)
own = sn.from_function(lambda *x: np.zeros((1, 200, 2, 3)), name="own")
def say(call):
    try:
        call()
    except Exception as error:
        print(type(error).__name__, error)
"""
MISTAKES = {
    "own.predict(scene, state, 0.2)": (
        "BadSetting `push` is 0.2; it must be a Push, for example Push(0.2), or "
        "Controls."
    ),
    "own.predict(scene, [[0, 0], [0.1, 0]], push)": (
        "BadSetting `state` is [[0, 0], [0.1, 0]]; it must be a State, for example of "
        "scene.in_a_row() or at_rest."
    ),
    "own.predict(0.9, state, push)": (
        "BadSetting `scene` is 0.9; it must be a Scene, for example of Scene.disks."
    ),
    "sn.at_rest([[0, 0, 0], [0.1, 0, 0]], [0, 0], [0, 0])": (
        "BadScene state: position has the shape [2, 3]; here it must be [2, 2]."
    ),
    "sn.at_rest([[0, 0], [0.1, 0]], [0, 0], [0, 0, 0])": (
        "BadScene state: pusher_position has the shape [3]; here it must be [2]."
    ),
    "sn.at_rest([0, 0], 0, [0, 0])": (
        "BadScene state: position has the shape [2]; here it must be [1, 2]."
    ),
    "own.predict(replace(scene, mass=[-0.9, 1]), state, push)": (
        "BadScene scene: mass is -0.9; it must be from 0.001 to 100 kg."
    ),
    "own.predict(replace(scene, radius=[54, 59]), state, push)": (
        "BadScene scene: radius is 54 (in millimetres?); it must be from 0.001 to 1 m."
    ),
    "own.predict(replace(scene, radius=[0.05] * 3), state, push)": (
        "BadScene scene: radius has the shape [3]; here it must be [2]."
    ),
    "own.predict(replace(scene, table_friction=[0.1, 0.2]), state, push)": (
        "BadScene scene: table_friction has the shape [2]; here it must be []."
    ),
    "sn.Push([0.1, 0.2], [0.1, 0.2, 0.3])": (
        "BadScene push: contact_angle, direction, length and speed have the shapes "
        "[(2,), (3,), (), ()]; give equal ones, or numbers."
    ),
    "own.predict(scene, state, sn.PathControls(still, still[:3]))": (
        "BadScene push: velocity has the shape [3, 2]; here it must be [4, 2]."
    ),
    "own.predict(scene, state, sn.PathControls(still[0], still[0]))": (
        "BadScene push: its controls have no axis, time; give [time, 2]."
    ),
    "own.predict(scene, state, sn.PathControls(still + np.nan, still))": (
        "BadScene push: position is nan; it must be from -100 to 100 m."
    ),
    'sn.tune("sani", "nowhere")': (
        "BadSetting `model` is sani; it must be one of in, sain, gp (did you mean "
        "sain?)."
    ),
    "sn.ControlConfig(model=own)": (
        "BadSetting `model` is <Model own>; it must be a name or a folder; "
        "`run_trials` takes a model of your own."
    ),
    "sn.run_trials(own)": (
        "BadSetting `config` is <Model own>; it must be a ControlConfig; give a model "
        "of your own as `model`."
    ),
    'sn.make_planner("greedy").plan("sani", None, scene, state)': (
        "UnknownName No model named 'sani' (did you mean sain?). Available: physics, "
        "physics-true, in, sain, sain-bullet, in-stroke, sain-stroke, sain-any, or the "
        "folder of a trained network."
    ),
}


@pytest.fixture(scope="module")
def answers() -> list[str]:
    return run(START + "".join(f"say(lambda: {call})\n" for call in MISTAKES))


def run(code: str) -> list[str]:
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return (done.stdout + done.stderr).splitlines()


@pytest.mark.parametrize("call", MISTAKES)
def test_a_mistake_is_answered_in_one_sentence(call, answers):
    assert answers[list(MISTAKES).index(call)] == MISTAKES[call]


WARN = """
sain, physics = sn.load("sain"), sn.load("physics")
for angle in (0.2, 3.0, 3.1):
    sain.predict(scene, state, sn.Push(angle), steps=2)
    physics.predict(scene, state, sn.Push(angle), steps=2)
sain.predict(scene, state, sn.Push([0.1, 0.2, 3.0], 1.0), steps=2)
import jax
jax.jit(lambda a: sain.predict(scene, state, sn.Push(a), steps=2).final)(3.0)
"""


def test_a_direction_without_training_is_warned_of_once_per_call():
    lines = [line for line in run(START + WARN) if "Warning" in line]
    trained = "is outside the model's training range"
    assert [line.partition(": ")[2] for line in lines] == [
        f"UserWarning: push: its contact angle {trained}",
        f"UserWarning: push: its contact angle {trained}",
        f"UserWarning: push: its direction {trained}",
    ]
    first, batch, again = (line.partition(": ")[0] for line in lines)
    assert first != batch == again  # one for each place of the call


def test_a_number_of_steps_may_be_one_of_numpy():
    predict = 'sn.load("physics").predict(scene, state, push, steps=np.int64(7))'
    assert run(f"{START}print({predict}.states.angle.shape)") == ["(7, 2)"]
