"""Adaptation corrects what affects pushes, keeps the rest, and follows a change."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from sainet.control.config import ControlConfig
from sainet.control.episode import Episode, run_episode
from sainet.control.trial import make_trial
from sainet.control.trials import prepare
from sainet.engines.base import AssumedProperties
from sainet.engines.planar.engine import PlanarEngine
from sainet.engines.simulator import Assumptions, InternalEngine, PlanarSpec
from sainet.identification.adaptation import REMEMBERED, Adaptation, Properties
from sainet.models.library import load_model
from sainet.runs.errors import BadInput
from sainet.scenes.pushes import Push, command_path
from sainet.scenes.recording import CameraOffset, Recording
from sainet.scenes.scene import Scene

STEPS = 120
TRUE = Scene.disks([0.9, 1.0], [0.054, 0.059])
ENGINE = PlanarEngine()
PUSHES = [(0.3, 0.2), (-0.5, 0.1), (0.8, -0.3), (-0.2, -0.4), (0.6, 0.4), (-0.8, 0.3)]


@eqx.filter_jit
def executed(scene, push, steps):
    one = jax.tree.map(lambda x: x[None], scene)
    state = jax.tree.map(lambda x: x[None], scene.in_a_row())
    push = jax.tree.map(lambda x: x[None], push)
    initial, controls = command_path(one, state, push, steps=steps)
    return initial, ENGINE.rollout(one, initial, controls).states


def recording_of(scene, angle, heading, *, trouble="", length=0.01, steps=STEPS):
    """A noise-free push of two touching disks with these true properties."""
    push = Push(jnp.float32(angle), jnp.float32(heading), jnp.float32(length))
    initial, states = executed(scene, push, steps)
    pose = lambda s: np.concatenate([s.position[0], s.angle[0][..., None]], axis=-1)  # noqa: E731
    path = np.concatenate([initial.pusher_position, states.pusher_position[0]])
    whole = np.concatenate([pose(initial)[None], pose(states)])
    sent = Push(angle, heading, length)
    return Recording(
        time=np.arange(steps + 1) / 240,
        pose=whole,
        pusher=path,
        commanded=sent,
        trouble=trouble,
    )


def wrong(scene, radius=(1.0, 1.0), mass=(1.0, 1.0)):
    new = scene.mass * jnp.array(mass), scene.radius * jnp.array(radius)
    return eqx.tree_at(lambda s: (s.mass, s.radius), scene, new)


def after(given, scenes, model="physics-true"):
    """Adaptation after a push of each scene, and the scene that it found."""
    adaptation = Adaptation(load_model(model), given)
    for number, scene in enumerate(scenes):
        adaptation.add(recording_of(scene, *PUSHES[number % len(PUSHES)]))
    return adaptation, adaptation.adapted(TRUE.in_a_row())[1]


@pytest.mark.parametrize("radius", [(0.9, 1.1), (1.1, 0.9), (1.1, 1.1), (0.9, 0.9)])
def test_wrong_radii_are_corrected_by_few_pushes(radius):
    given = wrong(TRUE, radius=radius)
    _, found = after(given, [TRUE] * 6)
    before = np.abs(given.radius / TRUE.radius - 1)
    left = np.abs(found.radius / TRUE.radius - 1)
    assert (np.asarray(left) < 0.25 * np.asarray(before)).all()


def test_long_pushes_count_to_their_ends():
    """A push of 40 mm takes 0.8 s, and adapts as one of 10 mm does."""
    given = wrong(TRUE, radius=(0.95, 1.05))
    adaptation = Adaptation(load_model("physics-true"), given)
    for angle, heading in PUSHES:
        push = recording_of(TRUE, angle, heading, length=0.04, steps=240)
        adaptation.add(push)
    _, found = adaptation.adapted(TRUE.in_a_row())
    assert np.allclose(found.radius, TRUE.radius, rtol=0.01)


def begun_late(recording, wait):
    """The recording of a robot that holds still for some steps, then pushes."""
    first = lambda x: np.concatenate([np.repeat(x[:1], wait, axis=0), x])  # noqa: E731
    time = np.arange(len(recording.time) + wait) / 240
    pose, pusher = first(recording.pose), first(recording.pusher)
    return replace(recording, time=time, pose=pose, pusher=pusher)


def test_recordings_that_begin_before_the_contact_count_to_their_ends():
    adaptation = Adaptation(load_model("physics-true"), wrong(TRUE, (0.95, 1.05)))
    for push in PUSHES:
        adaptation.add(begun_late(recording_of(TRUE, *push), wait=60))
    _, found = adaptation.adapted(TRUE.in_a_row())
    assert np.allclose(found.radius, TRUE.radius, rtol=0.005)


def test_the_time_step_of_the_scene_is_only_that_of_predictions():
    given = wrong(TRUE, (0.95, 1.05))
    _, usual = after(given, [TRUE] * 6)
    _, found = after(replace(given, time_step=1 / 120), [TRUE] * 6)
    assert found.time_step == 1 / 120
    assert np.allclose(found.radius, usual.radius, rtol=1e-6)


def test_properties_without_effect_stay_as_given():
    """In slow pushing only the ratio of masses has an effect, not their size."""
    given = wrong(TRUE, mass=(1.1, 1.1))
    _, found = after(given, [TRUE] * 6)
    assert float(found.mass[0]) == float(given.mass[0])
    assert float(found.table_friction) == float(given.table_friction)
    assert found.mass[1] / found.mass[0] == pytest.approx(1.0 / 0.9, rel=0.02)


def test_a_ratio_of_masses_is_corrected_slowly():
    given = wrong(TRUE, mass=(0.9, 1.1))
    _, found = after(given, [TRUE] * REMEMBERED)
    ratios = [float(s.mass[1] / s.mass[0]) for s in (TRUE, found, given)]
    assert ratios[0] < ratios[1] < ratios[0] + 0.9 * (ratios[2] - ratios[0])


def test_true_properties_are_kept():
    adaptation, found = after(TRUE, [TRUE] * 6)
    assert np.allclose(found.radius, TRUE.radius, rtol=2e-3)
    assert np.allclose(np.exp(adaptation.found.friction), 1, atol=0.03)


def test_disks_that_overlap_are_made_smaller_before_any_push():
    adaptation = Adaptation(load_model("physics-true"), wrong(TRUE, radius=(1.1, 1.1)))
    _, found = adaptation.adapted(TRUE.in_a_row())
    assert float(found.radius.sum()) == pytest.approx(float(TRUE.radius.sum()), 5e-3)


def test_a_new_surface_replaces_the_old_one():
    rough = eqx.tree_at(
        lambda s: (s.pusher_friction, s.disk_friction), TRUE, (jnp.float32(0.5),) * 2
    )
    _, before = after(TRUE, [TRUE] * REMEMBERED)
    adaptation, found = after(TRUE, [TRUE] * REMEMBERED + [rough] * REMEMBERED)
    assert float(before.disk_friction) == pytest.approx(0.25, rel=0.05)
    # The pusher sticks to disk 1 with either friction; the prior draws to 0.25.
    assert 0.38 < float(found.disk_friction) < 0.55
    assert len(adaptation._pushes) == REMEMBERED


def test_assumed_properties_are_only_where_physics_begins():
    model = load_model("physics")
    adaptation = Adaptation(model, TRUE)
    dynamics, scene = adaptation.adapted(TRUE.in_a_row())
    assert isinstance(dynamics.engine, AssumedProperties)
    assert dynamics.engine.assumptions == Assumptions()
    assumed = model.dynamics.engine.assume(TRUE)
    assert np.allclose(scene.radius, assumed.radius, rtol=1e-3)
    _, found = after(TRUE, [TRUE] * 6, model="physics")
    assert np.allclose(found.radius, TRUE.radius, rtol=0.01)


def test_a_network_stays_as_it_is_and_is_given_other_properties():
    given = wrong(TRUE, radius=(0.9, 1.1))
    adaptation, found = after(given, [TRUE] * 6, model="sain")
    dynamics, _ = adaptation.adapted(TRUE.in_a_row())
    assert dynamics is adaptation.model.dynamics
    assert np.allclose(found.radius, TRUE.radius, rtol=0.03)


def test_a_camera_offset_is_not_taken_for_other_properties():
    camera = CameraOffset(x=0.002, y=-0.001)
    model = load_model("physics-true")
    internal = InternalEngine(model.internal.simulator, camera)
    adaptation = Adaptation(replace(model, internal=internal), TRUE)
    for push in PUSHES:
        seen = recording_of(TRUE, *push)
        pusher = seen.pusher - np.array(camera.vector)  # where the robot sees it
        adaptation.add(replace(seen, pusher=pusher))
    dynamics, found = adaptation.adapted(TRUE.in_a_row())
    np.testing.assert_allclose(found.radius, TRUE.radius, rtol=2e-3)
    np.testing.assert_allclose(found.disk_friction, TRUE.disk_friction, rtol=0.02)
    assert dynamics.offset == camera


def test_pushes_with_trouble_are_left_out():
    adaptation = Adaptation(load_model("physics-true"), wrong(TRUE, radius=(0.9, 1.0)))
    adaptation.add(recording_of(TRUE, 0.1, 0.2, trouble="disk 1 did not move"))
    adaptation.adapted(TRUE.in_a_row())
    unknown = Properties.none(2)
    assert all(
        np.allclose(a, b, atol=1e-3)
        for a, b in zip(adaptation.found, unknown, strict=True)
    )


@pytest.mark.parametrize("seen", [[], [0], [0, 1]])
def test_pushes_whose_end_is_unknown_are_left_out(seen):
    """The camera sees disk 2 in few samples, and none of them shows where it ended."""
    adaptation = Adaptation(load_model("physics-true"), TRUE)
    whole = recording_of(TRUE, *PUSHES[0])
    time, pose, pusher = whole.time * 0.9, whole.pose.copy(), whole.pusher
    pose[np.isin(np.arange(len(time)), seen, invert=True), 1] = np.nan
    adaptation.add(replace(whole, time=time, pose=pose, pusher=pusher))
    assert len(adaptation._pushes) == 0


def test_a_recording_that_ends_before_rest_counts_to_its_last_pose():
    adaptation = Adaptation(load_model("physics-true"), wrong(TRUE, (0.95, 1.05)))
    for push in PUSHES:
        whole = recording_of(TRUE, *push)
        parts = {name: getattr(whole, name)[:72] for name in ("time", "pose", "pusher")}
        adaptation.add(replace(whole, **parts))
    _, found = adaptation.adapted(TRUE.in_a_row())
    assert np.allclose(found.radius, TRUE.radius, rtol=0.005)


def test_noise_of_poses_at_rest_and_whole_turns_have_no_effect():
    adaptation = Adaptation(load_model("physics-true"), wrong(TRUE, (0.95, 1.05)))
    sign = np.where(np.arange(STEPS + 1) % 2, 1, -1)[:, None, None]
    for push in PUSHES:
        whole = recording_of(TRUE, *push)
        pose = whole.pose.copy()
        pose[81:] += (sign * [2e-3, -2e-3, 0.05])[81:]
        pose[60:, :, 2] += 2 * np.pi
        adaptation.add(replace(whole, pose=pose))
    _, found = adaptation.adapted(TRUE.in_a_row())
    assert np.allclose(found.radius, TRUE.radius, rtol=0.005)


def test_properties_are_factors_of_those_that_are_given():
    factors = Properties(
        *(jnp.log(jnp.array(x)) for x in ([1.1, 0.9], [1.2], [2, 3])),
        jnp.log(jnp.float32(0.5)),
    )
    found = factors.scene(TRUE)
    np.testing.assert_allclose(found.radius, TRUE.radius * jnp.array([1.1, 0.9]), 1e-6)
    np.testing.assert_allclose(found.mass, TRUE.mass * jnp.array([1.0, 1.2]), 1e-6)
    frictions = found.pusher_friction, found.disk_friction, found.table_friction
    np.testing.assert_allclose(frictions, [0.5, 0.75, 0.15], 1e-6)
    ratio = factors.engine(jnp.float32(0.8)).pressure_radius_ratio
    assert float(ratio) == pytest.approx(0.4)


@pytest.mark.parametrize("name", ["in", "sain", "sain-bullet"])
def test_every_network_begins_with_the_given_properties(name):
    model = load_model(name)
    dynamics, found = Adaptation(model, TRUE).adapted(TRUE.in_a_row())
    assert dynamics is model.dynamics
    np.testing.assert_allclose(found.radius, TRUE.radius, rtol=1e-3)
    np.testing.assert_allclose(found.mass, TRUE.mass, rtol=1e-3)


def test_physics_begins_with_the_parameters_of_its_engine():
    model = load_model("physics-true")
    assumed = Assumptions(pusher_friction=0.4)
    spec = PlanarSpec(assumptions=assumed, pressure_radius_ratio=0.9)
    identified = replace(model, internal=InternalEngine(spec, CameraOffset()))
    dynamics, found = Adaptation(identified, TRUE).adapted(TRUE.in_a_row())
    ratio = dynamics.engine.engine.pressure_radius_ratio
    assert float(ratio) == pytest.approx(0.9, rel=1e-3)
    assert float(found.pusher_friction) == pytest.approx(0.4, rel=1e-3)


def test_an_observation_that_is_not_finite_changes_nothing():
    """The planner refuses it and names its field."""
    adaptation, before = after(wrong(TRUE, (0.95, 1.05)), [TRUE] * 2)
    state = TRUE.in_a_row()
    lost = eqx.tree_at(lambda s: s.position, state, state.position.at[1].set(jnp.nan))
    _, found = adaptation.adapted(lost)
    np.testing.assert_array_equal(found.radius, before.radius)


def test_other_engines_are_refused():
    with pytest.raises(BadInput, match="`adapt` uses the derivatives of the planar"):
        Adaptation(load_model("physics", engine="bullet"), TRUE)


def test_an_episode_adapts():
    config = ControlConfig(
        model="physics-true", property_error=0.1, adapt=True, noise_level="none"
    )
    model, planner = prepare(config)
    trial, episode = make_trial(config, 0), Episode()
    assert not np.allclose(trial.scene.radius, trial.robot.scene.radius, rtol=0.05)
    again = make_trial(config, 0).scene
    assert (again.radius == trial.scene.radius).all()
    plain = make_trial(replace(config, property_error=0.0), 0)
    assert np.allclose(plain.scene.radius, plain.robot.scene.radius)
    with trial.robot as robot:
        run_episode(
            robot,
            planner,
            model.dynamics,
            trial.task,
            trial.scene,
            pushes=4,
            episode=episode,
            adaptation=Adaptation(model, trial.scene),
        )
    used = [np.asarray(step.scene.radius) for step in episode.steps]
    true = np.asarray(trial.robot.scene.radius)
    errors = [np.abs(radius / true - 1).max() for radius in used]
    assert errors[-1] < 0.5 * errors[0]
