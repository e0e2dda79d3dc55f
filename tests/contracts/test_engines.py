"""What every engine in the registry has to obey, with physics as the oracle.

An engine is picked up by its line in `ENGINES`; how closely it must obey is written
in `worlds.TOLERANCES`.
"""

from functools import lru_cache
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from contracts.transforms import Placement, renumber_scene, renumber_state
from contracts.worlds import (
    FAR,
    TOLERANCES,
    engine,
    far_away,
    first_steps,
    free_scenes,
    later_steps,
    make_scene,
    moving,
    over_time,
    pushed,
    rows,
    together,
)
from sainet.datasets.config import GenerateConfig
from sainet.engines import ENGINES
from sainet.engines.base import roll_out
from sainet.scenes.controls import Controls, ForceControls, PathControls
from sainet.scenes.scene import GRAVITY, TIME_STEP, Scene, pair_gaps, pusher_gaps
from sainet.scenes.state import State, pack_motion

BATCH = 32  # scenes of each kind
STEPS = 120
CASES = [
    ("robot", 1),
    ("robot", 2),
    ("robot", 3),
    ("robot", 5),
    ("direct-force", 1),
    ("direct-force", 3),
]
PLACEMENTS = {
    "mirrored": Placement(mirror=-1.0),
    "turned": Placement(turn=0.7),
    "turned about": Placement(turn=-2.4),
    "moved": Placement(shift=(0.4, -0.3)),
    "all": Placement(mirror=-1.0, turn=1.9, shift=(-0.2, 0.1)),
}

every_engine = pytest.mark.parametrize("name", sorted(ENGINES))
every_case = pytest.mark.parametrize(("setup", "bodies"), CASES)


class Case(NamedTuple):
    """Pushes with the paper's distributions, and their motion in an engine."""

    scene: Scene
    initial: State
    controls: Controls
    states: State


@lru_cache
def case(name: str, setup: str, bodies: int) -> Case:
    """The pushes as drawn, then mirrored, turned, moved and renumbered."""
    config = GenerateConfig(setup=setup, disks=bodies, pushes=BATCH)
    scene, initial, controls = pushed(config, 1, STEPS)
    places = PLACEMENTS.values()
    order = swapped(bodies)
    starts = [initial, *(p.state(initial) for p in places)]
    commands = [controls, *(p.controls(controls) for p in places), controls]
    whole = (
        together(*[scene] * len(starts), renumber_scene(scene, order)),
        together(*starts, renumber_state(initial, order)),
        together(*commands),
    )
    return Case(*whole, roll_out(engine(name), *whole).states)


def swapped(bodies: int) -> list[int]:
    """Disks 2 and 3 trade places; disk 1 is the one that is pushed."""
    order = list(range(bodies))
    order[1:3] = order[1:3][::-1]
    return order


def part(states: State, index: int) -> State:
    return rows(states, slice(index * BATCH, (index + 1) * BATCH))


def assert_same_motion(found: State, wanted: State, tolerance: float):
    """Positions agree to a tolerance (m), angles to as much at a rim of 50 mm."""
    for field, lever in (("position", 1), ("angle", 0.05), ("pusher_position", 1)):
        gap = np.abs(np.asarray(getattr(found, field)) - getattr(wanted, field))
        assert lever * gap.max() < tolerance, f"{field} differs by {gap.max():.2g}"


def assert_same_on_average(found: State, wanted: State, tolerance: float):
    """Likewise the mean over scenes, steps and disks."""
    for field, lever in (("position", 1), ("angle", 0.05)):
        gap = lever * np.abs(np.asarray(getattr(found, field)) - getattr(wanted, field))
        assert gap.mean() < tolerance, f"{field} differs by {gap.mean():.2g}"


def energies(scene: Scene, velocity, spin) -> np.ndarray:
    """Kinetic energy of all disks of each scene (J), in double precision."""
    mass, radius = (np.asarray(x, np.float64) for x in (scene.mass, scene.radius))
    extra = (1,) * (np.ndim(spin) - 2)
    mass, radius = (x.reshape(len(x), *extra, -1) for x in (mass, radius))
    squared = np.sum(np.asarray(velocity, np.float64) ** 2, axis=-1)
    turning = radius**2 / 2 * np.asarray(spin, np.float64) ** 2
    return (mass * (squared + turning) / 2).sum(axis=-1)


# Coasting and spinning.


@every_engine
def test_coasting_disks_stop_at_the_coulomb_distance(name):
    friction = np.repeat([0.05, 0.1, 0.2, 0.3], 2)
    # The step is first order: one that is short against the time to stop is honest.
    speed = np.tile([0.6, 0.8], 4) * np.sqrt(friction / 0.2)
    heading = np.linspace(0, 6, 8)
    along = np.stack([np.cos(heading), np.sin(heading)], -1)
    scene = make_scene(
        np.linspace(0.3, 3, 8)[:, None], np.full((8, 1), 0.05), table=friction
    )
    start = moving(np.zeros((8, 1, 2)), (speed[:, None] * along)[:, None])
    states = roll_out(engine(name), scene, start, far_away(8, 480)).states
    slowing = friction * GRAVITY
    travel = np.sum(np.asarray(states.position[:, -1, 0]) * along, -1)
    moved = np.linalg.norm(states.velocity[:, :, 0], axis=-1) > 1e-6
    relative = TOLERANCES[name].stopping
    np.testing.assert_allclose(travel, speed**2 / (2 * slowing), rtol=relative)
    np.testing.assert_allclose(moved.sum(1) * TIME_STEP, speed / slowing, rtol=relative)
    assert np.abs(states.angle).max() < TOLERANCES[name].yaw


@every_engine
def test_spinning_disks_stop_at_the_angle_of_their_pressure(name):
    friction = np.repeat([0.05, 0.1, 0.2], 2)
    radius = np.tile([0.05, 0.06], 3)
    spin = np.array([20, -20, 25, -25, 30, 30.0])
    mass = np.linspace(0.3, 3, 6)
    scene = make_scene(mass[:, None], radius[:, None], table=friction)
    start = moving(np.zeros((6, 1, 2)), 0.0, spin[:, None])
    final = roll_out(engine(name), scene, start, far_away(6, 480)).final
    inertia = mass * radius**2 / 2
    arm = TOLERANCES[name].pressure_ratio * radius
    wanted = inertia * spin * np.abs(spin) / (2 * friction * mass * GRAVITY * arm)
    np.testing.assert_allclose(
        final.angle[:, 0], wanted, rtol=TOLERANCES[name].stopping
    )
    assert np.abs(final.position).max() < 1e-6


@every_engine
def test_kinetic_energy_never_grows_without_the_pusher(name):
    count = 96 if engine(name).on_host else 384  # on the host they go one by one
    for bodies, seed in ((2, 1), (3, 2), (5, 3)):
        rng = np.random.default_rng(seed)
        table, contact = rng.uniform(0, 0.4, count), rng.uniform(0, 0.8, count)
        scene, start = free_scenes(rng, count, bodies, table=table, contact=contact)
        states = roll_out(engine(name), scene, start, far_away(count, STEPS)).states
        first = energies(scene, start.velocity[:, None], start.spin[:, None])
        after = energies(scene, states.velocity, states.spin)
        energy = np.concatenate([first, after], axis=1)
        growth = energy[:, 1:] - energy[:, :-1] * (1 + TOLERANCES[name].energy)
        assert growth.max() < TOLERANCES[name].still_energy, (
            f"{bodies} disks gain {growth.max():.2g} J"
        )
        assert (energy[:, -1] < energy[:, 0]).all()


@every_engine
def test_bodies_at_rest_stay_at_rest(name):
    config = GenerateConfig(disks=3, pushes=16)
    scene, start, _ = pushed(config, 5, 60)
    # 0.1 mm apart: which of two touching disks rounding takes for an overlap is chance.
    spread = eqx.tree_at(lambda s: s.position, start, start.position * 1.001)
    spread = eqx.tree_at(lambda s: s.pusher_position, spread, jnp.full((16, 2), FAR))
    states = roll_out(engine(name), scene, spread, far_away(16, 60)).states
    most = TOLERANCES[name].rest
    assert np.abs(states.position - over_time(spread.position, 60)).max() <= most
    assert np.abs(states.velocity).max() <= most
    assert np.abs(states.spin).max() <= 20 * most


# Pushing.


@every_engine
@every_case
def test_pushed_disks_move_without_overlap(name, setup, bodies):
    scene, _, _, states = case(name, setup, bodies)
    scenes = over_time(scene, STEPS)
    pusher = np.asarray(pusher_gaps(scenes, states))
    disks = np.asarray(pair_gaps(scenes, states))
    limit = TOLERANCES[name].overlap[bodies]
    assert pusher.min() > -limit
    assert disks.min() > -limit
    assert np.abs(pusher[:, :40, 0]).max() < limit, "disk 1 loses the pusher"
    speed = np.linalg.norm(states.velocity[:, 40, 0], axis=-1)
    assert np.median(speed) > {"robot": 0.03, "direct-force": 0.003}[setup]


@every_engine
def test_quasi_static_path_does_not_depend_on_table_friction(name):
    config = GenerateConfig(disks=1, pushes=24, speed_mm_s=(4.0,), stroke_mm=(6.0,))
    scenes = [pushed(config, 3, 400, table=friction) for friction in (0.05, 0.25)]
    final = roll_out(
        engine(name), *(together(*pair) for pair in zip(*scenes, strict=True))
    ).final
    low, high = (rows(final, slice(24)), rows(final, slice(24, None)))
    tolerance = TOLERANCES[name].path
    assert np.abs(low.position - high.position).max() < tolerance
    assert np.abs(low.angle - high.angle).max() < tolerance / 0.05
    assert np.abs(low.angle).max() > 0.01, "nothing turned: the test shows nothing"


@every_engine
def test_contacts_stick_or_slip_by_coulombs_law(name):
    """A disk at rest on ice, hit at an angle: stuck if tan(angle) <= 3 mu.

    Seen from the contact a disk weighs m along the normal and m / 3 across it.
    """
    angle, friction = (
        x.ravel() for x in np.meshgrid([0.1, 0.5, -0.7, 1.1], [0, 0.1, 0.25, 0.6])
    )
    count, radius, pusher_radius, speed = len(angle), 0.05, 0.005, 0.05
    scene = make_scene(
        np.full((count, 1), 0.9),
        np.full((count, 1), radius),
        table=0.0,
        contact=friction,
        pusher_radius=pusher_radius,
    )
    start = moving(np.full((count, 1, 2), [radius + pusher_radius, 0.0]), 0.0)
    start = eqx.tree_at(lambda s: s.pusher_position, start, jnp.zeros((count, 2)))
    heading = np.stack([np.cos(angle), np.sin(angle)], -1)
    steps = TOLERANCES[name].impact_steps
    after = roll_out(
        engine(name), scene, start, _straight(speed * heading, steps)
    ).final
    across = np.clip(
        np.sin(angle) / 3, -friction * np.cos(angle), friction * np.cos(angle)
    )
    assert np.any(across == np.sin(angle) / 3)
    assert np.any(across != np.sin(angle) / 3)
    wanted = speed * np.stack([np.cos(angle), across], -1)
    tolerance = TOLERANCES[name].impact
    np.testing.assert_allclose(after.velocity[:, 0], wanted, atol=tolerance)
    turning = -2 * speed * across / radius
    np.testing.assert_allclose(after.spin[:, 0], turning, atol=tolerance / radius)


def _straight(velocity, steps: int) -> PathControls:
    time = np.arange(1, steps + 1)[None, :, None] * TIME_STEP
    return PathControls(
        position=jnp.asarray(velocity[:, None] * time, jnp.float32),
        velocity=jnp.asarray(np.repeat(velocity[:, None], steps, 1), jnp.float32),
    )


@every_engine
def test_free_force_driven_pusher_obeys_its_damper(name):
    scene = make_scene(np.ones((2, 1)), np.full((2, 1), 0.05))
    start = moving(np.zeros((2, 1, 2)), 0.0)
    force = np.array([[8.0, 0.0], [-3.0, 4.0]])
    controls = ForceControls(
        force=jnp.asarray(np.repeat(force[:, None], 60, 1), jnp.float32),
        contact_offset=start.pusher_position,
    )
    states = roll_out(engine(name), scene, start, controls).states
    velocity = np.asarray(states.pusher_velocity)
    before = np.concatenate([np.zeros((2, 1, 2)), velocity[:, :-1]], 1)
    change = TIME_STEP / 10.0 * (force[:, None] - 1000.0 * before)
    np.testing.assert_allclose(velocity - before, change, atol=2e-9)
    np.testing.assert_allclose(velocity[:, -1], force / 1000.0, rtol=1e-6)


# Collisions on ice.


def _collisions(name: str):
    """Touching disks that approach each other at all angles, on ice."""
    rng = np.random.default_rng(11)
    radius = rng.uniform(0.04, 0.07, (64, 2))
    heading = rng.uniform(0, 2 * np.pi, 64)
    normal = np.stack([np.cos(heading), np.sin(heading)], -1)
    centres = np.stack([0 * normal, radius.sum(1)[:, None] * normal], 1)
    velocity = rng.normal(0, 0.3, (64, 2, 2))
    approach = np.sum((velocity[:, 0] - velocity[:, 1]) * normal, -1)
    velocity[approach < 0] *= -1
    scene = make_scene(rng.uniform(0.5, 2, (64, 2)), radius, table=0.0)
    start = moving(centres, velocity, rng.normal(0, 5, (64, 2)))
    return (
        scene,
        start,
        roll_out(engine(name), scene, start, far_away(64, 60)).states,
        normal,
    )


def _momenta(scene: Scene, position, velocity, spin):
    """Linear and angular momentum of each scene, in double precision."""
    values = (scene.mass, scene.radius, position, velocity, spin)
    mass, radius, p, v, w = (np.asarray(x, np.float64) for x in values)
    turning = p[..., 0] * v[..., 1] - p[..., 1] * v[..., 0] + radius**2 / 2 * w
    return (mass[..., None] * v).sum(-2), (mass * turning).sum(-1)


@every_engine
def test_collisions_without_friction_conserve_momentum(name):
    scene, start, states, _ = _collisions(name)
    before = _momenta(scene, start.position, start.velocity, start.spin)
    after = _momenta(
        scene, states.position[:, -1], states.velocity[:, -1], states.spin[:, -1]
    )
    relative = TOLERANCES[name].momentum
    assert np.abs(states.spin[:, -1] - start.spin).max() > 1, "no friction was tested"
    np.testing.assert_allclose(after[0], before[0], atol=relative)
    np.testing.assert_allclose(after[1], before[1], atol=0.1 * relative)


@every_engine
def test_collisions_do_not_bounce(name):
    _, start, states, normal = _collisions(name)
    approach = np.sum((start.velocity[:, 0] - start.velocity[:, 1]) * normal, -1)
    after = np.asarray(states.velocity[:, TOLERANCES[name].impact_steps - 1])
    parting = np.sum((after[:, 1] - after[:, 0]) * normal, -1)
    assert np.median(approach) > 0.1
    assert np.abs(parting).max() < TOLERANCES[name].parting


# Symmetries.


@every_engine
@every_case
@pytest.mark.parametrize("change", PLACEMENTS)
def test_transformed_scenes_have_the_transformed_motion(name, setup, bodies, change):
    index = 1 + list(PLACEMENTS).index(change)
    states = case(name, setup, bodies).states
    wanted = PLACEMENTS[change].state(part(states, 0))
    tolerance = TOLERANCES[name]
    found = part(states, index)
    assert_same_motion(found, wanted, tolerance.worst_symmetry)
    assert_same_on_average(found, wanted, tolerance.symmetry)


@every_engine
@pytest.mark.parametrize(("setup", "bodies"), [c for c in CASES if c[1] > 2])
def test_permuted_disks_permute_the_motion(name, setup, bodies):
    states = case(name, setup, bodies).states
    wanted = renumber_state(part(states, 0), swapped(bodies))
    found = part(states, len(PLACEMENTS) + 1)
    assert_same_motion(found, wanted, TOLERANCES[name].permutation)


# Bookkeeping.


def _overlapping(bodies: int) -> tuple[Scene, State]:
    """Disks that sink up to 8 mm into each other at the start."""
    config = GenerateConfig(disks=bodies, pushes=BATCH, radius_mm=(50.0, 54.0))
    scene, start, _ = pushed(config, 8, 1)
    factor = np.random.default_rng(0).uniform(0.97, 1.03, scene.radius.shape)
    bigger = eqx.tree_at(
        lambda s: s.radius, scene, scene.radius * jnp.asarray(factor, jnp.float32)
    )
    return bigger, eqx.tree_at(
        lambda s: s.pusher_position, start, jnp.full((BATCH, 2), FAR)
    )


def assert_steps_add_up(initial: State, states: State):
    """p(t+1) = p(t) + dt v(t+1) to the rounding of single precision."""
    pairs = [
        (initial.position, states.position, states.velocity),
        (initial.angle, states.angle, states.spin),
        (initial.pusher_position, states.pusher_position, states.pusher_velocity),
    ]
    for start, *after in pairs:
        pose, rate = (np.asarray(values, np.float64) for values in after)
        before = np.concatenate([np.asarray(start)[:, None], pose[:, :-1]], axis=1)
        error = np.abs(before + TIME_STEP * rate - pose)
        rounding = np.spacing(np.abs(pose).astype(np.float32) + np.float32(0.01))
        assert (error <= rounding).all(), f"off by {error.max():.2g}"


@every_engine
@every_case
def test_poses_are_sums_of_velocities(name, setup, bodies):
    found = case(name, setup, bodies)
    assert_steps_add_up(found.initial, found.states)


@every_engine
@pytest.mark.parametrize("bodies", [2, 5])
def test_overlaps_are_corrected_by_real_velocities(name, bodies):
    scene, start = _overlapping(bodies)
    states = roll_out(engine(name), scene, start, far_away(BATCH, 240)).states
    assert_steps_add_up(start, states)
    depth = -np.asarray(pair_gaps(scene, start)).min((1, 2))
    left = -np.asarray(pair_gaps(over_time(scene, 240), states)).min((2, 3))
    assert depth.max() > 1e-3
    assert left[:, -1].max() < TOLERANCES[name].overlap_left
    assert left[:, :24].max() < depth.max() + 1e-6, "an overlap grew"


@every_engine
@pytest.mark.parametrize(("setup", "bodies"), [("robot", 2), ("direct-force", 3)])
def test_two_advances_equal_one(name, setup, bodies):
    drawn = (rows(tree, slice(BATCH)) for tree in case(name, setup, bodies))
    scene, start, controls, states = drawn
    half = STEPS // 2
    one = roll_out(engine(name), scene, start, first_steps(controls, half))
    two = roll_out(engine(name), scene, one.final, later_steps(controls, half))
    most = TOLERANCES[name].advance
    sizes = {"position": 1, "angle": 20, "velocity": 240, "spin": 5000}
    for field, size in (sizes | {"pusher_velocity": 240}).items():
        again = [getattr(states, field) for states in (one.states, two.states)]
        gap = np.abs(np.concatenate(again, axis=1) - getattr(states, field))
        assert gap.max() <= size * most, f"{field} differs by {gap.max():.2g}"


@every_engine
@pytest.mark.parametrize(("setup", "bodies"), [("robot", 2), ("direct-force", 3)])
def test_a_single_scene_moves_as_in_a_batch(name, setup, bodies):
    scene, start, controls, states = case(name, setup, bodies)
    for row in (3, 40):
        alone = roll_out(
            engine(name),
            *(rows(tree, slice(row, row + 1)) for tree in (scene, start, controls)),
        ).states
        in_batch = rows(states, slice(row, row + 1))
        assert_same_motion(alone, in_batch, 1e-6)


@every_engine
def test_scenes_may_have_any_batch_axes(name):
    scene, start, controls, states = case(name, "robot", 2)
    first = tuple(rows(tree, slice(0, 4)) for tree in (scene, start, controls))
    grid = jax.tree.map(lambda x: x.reshape(2, 2, *x.shape[1:]), first)
    single = jax.tree.map(lambda x: x[0], first)
    for found, wanted in (
        (
            roll_out(engine(name), *grid).states,
            states.position[:4].reshape(2, 2, STEPS, 2, 2),
        ),
        (roll_out(engine(name), *single).states, states.position[0]),
    ):
        assert found.position.shape == wanted.shape
        np.testing.assert_allclose(found.position, wanted, atol=1e-6)


@every_engine
def test_coinciding_disks_and_zero_friction_give_no_nan(name):
    scene, start, controls = pushed(
        GenerateConfig(disks=3, pushes=12),
        2,
        60,
        table=np.repeat([0.0, 0.2], 6),
        contact=np.tile([0.0, 0.3], 6),
    )
    same = start.position.at[:, 1].set(start.position[:, 0])
    same = same.at[:6, 2].set(start.pusher_position[:6])
    start = eqx.tree_at(lambda s: s.position, start, same)
    trajectory = roll_out(engine(name), scene, start, controls)
    assert np.isfinite(pack_motion(trajectory.states)).all()
    assert np.abs(trajectory.states.position).max() < 1


# Gradients.


class Knobs(eqx.Module):
    """What gradients are taken with respect to, one number for each scene."""

    ahead: jax.Array  # m, of disk 1
    aside: jax.Array  # m, of disk 1
    table_friction: jax.Array
    contact_friction: jax.Array


def _final_pose(name: str, knobs: Knobs, ratio, angle, bodies: int):
    """A weighted sum of the final poses of each scene, in double precision."""
    count = angle.shape[0]
    places = 0.1055 * np.arange(bodies)[:, None] * np.array([1.0, 0.0])
    position = jnp.broadcast_to(jnp.asarray(places), (count, bodies, 2))
    shift = jnp.stack([knobs.ahead, knobs.aside], -1)
    position = position.at[:, 0].add(shift)
    scene = Scene(
        mass=jnp.ones((count, bodies)),
        radius=jnp.full((count, bodies), 0.052),
        table_friction=knobs.table_friction,
        disk_friction=knobs.contact_friction,
        pusher_friction=knobs.contact_friction,
        pusher_radius=jnp.full(count, 0.005),
    )
    heading = jnp.stack([jnp.cos(angle), jnp.sin(angle)], -1)
    pusher = jnp.broadcast_to(jnp.array([-0.0585, 0.0]), (count, 2))
    time = (jnp.arange(1, 37) * TIME_STEP)[None, :, None]
    controls = PathControls(
        position=pusher[:, None] + 0.05 * time * heading[:, None],
        velocity=jnp.broadcast_to(0.05 * heading[:, None], (count, 36, 2)),
    )
    still = jnp.zeros((count, bodies))
    start = State(
        position=position,
        angle=still,
        velocity=0 * position,
        spin=still,
        pusher_position=pusher,
        pusher_velocity=0 * pusher,
    )
    tuned = eqx.tree_at(lambda e: e.pressure_radius_ratio, engine(name), ratio)
    final = tuned.rollout(scene, start, controls).final
    weight = jnp.array([1.0, 0.7])[:bodies]
    pose = final.position[..., 0] + 2 * final.position[..., 1] + 0.1 * final.angle
    return pose @ weight


def _knobs(count: int) -> tuple[Knobs, jax.Array]:
    """Settings away from where contacts begin, end, or start to slip."""
    angle = jnp.linspace(-0.42, 0.46, count)
    knobs = Knobs(
        ahead=jnp.full(count, 1e-4),
        aside=jnp.linspace(0.006, -0.007, count),
        table_friction=jnp.linspace(0.08, 0.22, count),
        contact_friction=jnp.linspace(0.3, 0.15, count),
    )
    return knobs, angle


def _slopes(name: str, bodies: int, step: float):
    """Gradients of each scene's final pose, and the same by central differences."""
    knobs, angle = _knobs(12)
    ratio = jnp.asarray(TOLERANCES[name].pressure_ratio)

    def final(knobs, ratio):
        return _final_pose(name, knobs, ratio, angle, bodies)

    jitted = jax.jit(final)
    # Scenes do not touch each other: the gradient of the sum is every scene's own.
    gradient = jax.jit(jax.grad(lambda *at: final(*at).sum(), argnums=(0, 1)))
    found, turned = gradient(knobs, ratio)
    change = jitted(knobs, ratio + step) - jitted(knobs, ratio - step)
    yield "pressure_radius_ratio", turned, change.sum() / (2 * step)
    for field in ("ahead", "aside", "table_friction", "contact_friction"):
        low, high = (_shifted(knobs, field, by) for by in (-step, step))
        change = jitted(high, ratio) - jitted(low, ratio)
        yield field, getattr(found, field), change / (2 * step)


def _shifted(knobs: Knobs, field: str, by: float) -> Knobs:
    return eqx.tree_at(lambda k: getattr(k, field), knobs, getattr(knobs, field) + by)


@pytest.mark.parametrize("name", [n for n in ENGINES if TOLERANCES[n].differentiable])
@pytest.mark.parametrize("bodies", [2])
def test_gradients_equal_finite_differences(name, bodies):
    with jax.enable_x64(True):
        # A step so small that it hardly ever takes a contact past a switch.
        for field, gradient, difference in _slopes(name, bodies, 1e-8):
            np.testing.assert_allclose(
                gradient, difference, rtol=1e-3, atol=2e-6, err_msg=field
            )
            assert np.abs(gradient).max() > 1e-4, f"{field} changes nothing"
