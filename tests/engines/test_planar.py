"""The planar engine: its two solvers, and a slow reference written from the physics."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from contracts.worlds import (
    far_away,
    free_scenes,
    over_time,
    pushed,
    rows,
)
from engines.naive import Body, World
from sainet.datasets.config import GenerateConfig
from sainet.engines.base import roll_out
from sainet.engines.planar import solver
from sainet.engines.planar.engine import PlanarEngine
from sainet.engines.planar.solver import contact_budget, solve_close_pairs
from sainet.scenes.pushes import Push, command_path
from sainet.scenes.scene import FrictionField, Scene, pair_gaps, pusher_gaps

STEPS = 50


def naive_world(scene, start, pusher_mass: float) -> World:
    def body(i: int) -> Body:
        return Body(
            radius=float(scene.radius[0, i]),
            mass=float(scene.mass[0, i]),
            position=np.asarray(start.position[0, i], float),
            velocity=np.asarray(start.velocity[0, i], float),
            spin=float(start.spin[0, i]),
        )

    pusher = Body(
        radius=float(scene.pusher_radius[0]),
        mass=pusher_mass,
        position=np.asarray(start.pusher_position[0], float),
        velocity=np.zeros(2),
        on_table=False,
    )
    return World(
        disks=[body(i) for i in range(scene.body_count)],
        pusher=pusher,
        table_friction=float(scene.table_friction[0]),
        disk_friction=float(scene.disk_friction[0]),
        pusher_friction=float(scene.pusher_friction[0]),
    )


def naive_path(scene, start, controls) -> tuple[np.ndarray, np.ndarray]:
    """Positions and angles after each step, by the reference."""
    by_path = controls.pusher_path is not None
    world = naive_world(scene, start, controls.pusher.mass)
    places, angles = [], []
    for command in np.asarray(controls.command[0], float):
        (world.follow if by_path else world.push)(command)
        places.append([disk.position for disk in world.disks])
        angles.append([disk.angle for disk in world.disks])
    return np.array(places), np.array(angles)


@pytest.mark.parametrize(
    ("setup", "bodies"),
    [("robot", 2), ("direct-force", 5)],
)
def test_engine_agrees_with_the_slow_reference(setup, bodies):
    config = GenerateConfig(setup=setup, disks=bodies, pushes=2)
    for seed in (0, 1):
        whole = pushed(config, seed, STEPS)
        states = roll_out(PlanarEngine(), *whole).states
        for row in range(2):
            one = [rows(tree, slice(row, row + 1)) for tree in whole]
            position, angle = naive_path(*one)
            np.testing.assert_allclose(states.position[row], position, atol=1e-5)
            np.testing.assert_allclose(states.angle[row], angle, atol=2e-4)


def test_collisions_agree_with_the_slow_reference():
    scene, start = free_scenes(np.random.default_rng(4), 6, 3)
    states = roll_out(PlanarEngine(), scene, start, far_away(6, STEPS)).states
    assert np.asarray(pair_gaps(over_time(scene, STEPS), states)).min() < 1e-4
    for row in range(6):
        one = [rows(tree, slice(row, row + 1)) for tree in (scene, start)]
        still = rows(far_away(6, STEPS), slice(0, 1))
        position, angle = naive_path(*one, still)
        np.testing.assert_allclose(states.position[row], position, atol=1e-5)
        np.testing.assert_allclose(states.angle[row], angle, atol=2e-4)


@pytest.mark.parametrize(("bodies", "setup"), [(5, "robot"), (6, "direct-force")])
def test_both_solvers_agree(monkeypatch, bodies, setup):
    """Close pairs where all pairs are affordable, and the other way round."""
    whole = pushed(GenerateConfig(setup=setup, disks=bodies, pushes=32), 6, 80)
    as_chosen = roll_out(PlanarEngine(), *whole).states
    if bodies * (bodies + 1) // 2 > solver.MOST_PAIRS:
        monkeypatch.setattr(solver, "solve_close_pairs", solver.solve_all_pairs)
    else:
        monkeypatch.setattr(solver, "solve_all_pairs", solve_close_pairs)
    # Other settings than above, or the compiled rollout would be used again.
    other = roll_out(PlanarEngine(recovery=0.0800001), *whole).states
    np.testing.assert_allclose(other.position, as_chosen.position, atol=1e-5)
    np.testing.assert_allclose(other.angle, as_chosen.angle, atol=2e-4)


def test_the_contact_budget_is_that_of_a_planar_graph():
    assert [contact_budget(n) for n in range(2, 9)] == [1, 3, 6, 9, 12, 15, 18]


def test_more_sweeps_reduce_the_overlap_of_five_disks():
    config = GenerateConfig(disks=5, pushes=32)
    scene, *push = pushed(config, 1, 80)
    deepest = []
    for sweeps in (10, 80):
        states = roll_out(PlanarEngine(sweeps=sweeps), scene, *push).states
        scenes = over_time(scene, 80)
        disks = np.asarray(pair_gaps(scenes, states)).min()
        deepest.append(-min(disks, np.asarray(pusher_gaps(scenes, states)).min()))
    assert deepest[1] < 1e-5
    assert deepest[1] < deepest[0]


@pytest.mark.parametrize(
    ("mass", "sweeps", "deepest"),
    [(1.0, 10, 1e-6), (0.3, 10, 3e-5), (0.1, 10, 2.2e-4), (0.1, 100, 1e-6)],
)
def test_a_pusher_overlaps_a_light_disk_that_pushes_a_heavy_disk(mass, sweeps, deepest):
    """As `docs/limits.md` states it."""
    scene = Scene.disks(mass=[mass, 1.0], radius=0.055)
    push = command_path(scene, scene.in_a_row(), Push(0.2, 0.1), steps=160)
    states = roll_out(PlanarEngine(sweeps=sweeps), scene, *push).states
    scenes = jax.tree.map(lambda x: jnp.broadcast_to(x, (160, *x.shape)), scene)
    overlap = -float(pusher_gaps(scenes, states).min())
    assert overlap < deepest
    if sweeps == 10 and mass < 1.0:
        assert overlap > 0.7 * deepest


def test_a_step_is_the_first_of_a_rollout():
    scene, start, controls = pushed(GenerateConfig(pushes=8), 2, STEPS)
    engine = PlanarEngine()
    rolled = roll_out(engine, scene, start, controls).states
    stepped = eqx.filter_jit(engine.step)(
        scene, start, controls, controls.position[:, 0]
    )
    np.testing.assert_allclose(stepped.position, rolled.position[:, 0], atol=1e-7)
    np.testing.assert_allclose(stepped.velocity, rolled.velocity[:, 0], atol=1e-6)


def test_pressure_at_the_rim_stops_a_spin_in_two_thirds_of_the_angle():
    scene, start = free_scenes(np.random.default_rng(0), 4, 1)
    start = eqx.tree_at(lambda s: s.velocity, start, jnp.zeros((4, 1, 2)))
    start = eqx.tree_at(lambda s: s.spin, start, jnp.full((4, 1), 20.0))
    turned = [
        np.asarray(roll_out(engine, scene, start, far_away(4, 240)).final.angle)
        for engine in (PlanarEngine(), PlanarEngine(pressure_radius_ratio=1.0))
    ]
    np.testing.assert_allclose(turned[1] / turned[0], 2 / 3, rtol=0.02)


def test_a_friction_field_multiplies_the_friction_of_the_table():
    scene, start = free_scenes(np.random.default_rng(0), 4, 1, table=0.1)
    flat = FrictionField(
        wave=jnp.zeros((4, 1, 2)), phase=jnp.zeros((4, 1)), amplitude=jnp.full(4, 0.5)
    )
    rough = eqx.tree_at(
        lambda s: s.friction_field, scene, flat, is_leaf=lambda x: x is None
    )
    higher = eqx.tree_at(lambda s: s.table_friction, scene, jnp.full(4, 0.15))
    found, wanted = (
        roll_out(PlanarEngine(), one, start, far_away(4, 60)).final
        for one in (rough, higher)
    )
    np.testing.assert_allclose(found.position, wanted.position, atol=1e-6)
