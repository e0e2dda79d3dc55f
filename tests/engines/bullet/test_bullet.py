"""What is Bullet's own: its bits, its processes, its friction, and life without it."""

import multiprocessing
import os
import signal
import subprocess
import sys
from concurrent.futures import wait
from importlib.util import find_spec

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from contracts.worlds import far_away, make_scene, moving, pushed, rows
from sainet.datasets.config import GenerateConfig
from sainet.engines import make_engine
from sainet.engines.base import roll_out
from sainet.engines.bullet import engine as bullet
from sainet.engines.bullet import world
from sainet.runs.errors import BadScene, MissingExtra, SainetError
from sainet.scenes.scene import GRAVITY, FrictionField
from support import require


@pytest.fixture(autouse=True)
def _installed():
    require(find_spec("pybullet"), "PyBullet is not installed")


def same_bits(one, other) -> bool:
    pairs = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return all(np.array_equal(a, b) for a, b in pairs)


@pytest.mark.parametrize("setup", ["robot", "direct-force"])
def test_a_push_does_not_depend_on_earlier_pushes(setup):
    engine = make_engine("bullet")
    some = pushed(GenerateConfig(setup=setup, disks=2, pushes=4), 1, 60)
    others = pushed(GenerateConfig(disks=3, pushes=6), 2, 40)
    before = roll_out(engine, *some).states
    roll_out(engine, *others)
    assert same_bits(roll_out(engine, *some).states, before)
    # The other way round, within one batch.
    backwards = roll_out(engine, *rows(some, slice(None, None, -1))).states
    assert same_bits(rows(backwards, slice(None, None, -1)), before)


def test_worker_processes_give_identical_results():
    many = pushed(GenerateConfig(disks=2, pushes=24), 3, 60)
    together = roll_out(make_engine("bullet"), *many).states
    for row in (0, 13, 23):
        part = slice(row, row + 1)
        alone = roll_out(make_engine("bullet"), *rows(many, part)).states
        assert same_bits(alone, rows(together, part))


def test_a_killed_process_is_reported_and_replaced():
    many = pushed(GenerateConfig(disks=1, pushes=9), 3, 2)
    before = roll_out(make_engine("bullet"), *many).states
    wait([bullet._pool().submit(os._exit, 1)])
    with pytest.raises(SainetError, match="a worker process was killed"):
        roll_out(make_engine("bullet"), *many)
    assert same_bits(roll_out(make_engine("bullet"), *many).states, before)


def test_interrupted_processes_are_replaced():
    many = pushed(GenerateConfig(disks=1, pushes=9), 3, 2)
    before = roll_out(make_engine("bullet"), *many).states
    for process in multiprocessing.active_children():
        os.kill(process.pid, signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        roll_out(make_engine("bullet"), *many)
    assert same_bits(roll_out(make_engine("bullet"), *many).states, before)


def test_varying_friction_acts_at_the_position_of_each_disk():
    """Two disks far apart coast through fields that are constant where each is."""
    scene = make_scene(np.ones((1, 2)), np.full((1, 2), 0.05), table=0.1)
    # cos is +1 at x = 0 and -1 at x = 1, and flat at both.
    field = FrictionField(
        wave=jnp.array([[[np.pi, 0.0]]]),
        phase=jnp.zeros((1, 1)),
        amplitude=jnp.array([0.5]),
    )
    uneven = eqx.tree_at(
        lambda s: s.friction_field, scene, field, is_leaf=lambda x: x is None
    )
    start = moving([[[0.0, 0.0], [1.0, 0.0]]], [[[0.0, 0.2], [0.0, 0.2]]])
    final = roll_out(make_engine("bullet"), uneven, start, far_away(1, 240)).final
    travel = np.asarray(final.position[0, :, 1])
    wanted = 0.2**2 / (2 * GRAVITY * 0.1 * np.array([1.5, 0.5]))
    np.testing.assert_allclose(travel, wanted, rtol=0.05)


def test_the_pusher_follows_its_path():
    scene, start, controls = pushed(GenerateConfig(disks=2, pushes=4), 5, 100)
    states = roll_out(make_engine("bullet"), scene, start, controls).states
    gap = np.abs(np.asarray(states.pusher_position) - controls.position)
    assert gap.max() < 2e-6


@pytest.mark.parametrize(
    ("version", "wanted"),
    [
        ((3, 11), "pip install 'sainet.bullet.'"),
        ((3, 13), "no wheels.*3.13.*installs nothing"),
    ],
)
def test_without_pybullet_the_message_names_the_extra(version, wanted, monkeypatch):
    monkeypatch.setattr("sainet.engines.bullet.engine.find_spec", lambda _: None)
    monkeypatch.setattr(sys, "version_info", (*version, 0))
    with pytest.raises(MissingExtra, match=wanted):
        make_engine("bullet")


def test_bodies_never_sleep():
    import pybullet

    assert world._NEVER_SLEEPS == pybullet.ACTIVATION_STATE_DISABLE_SLEEPING


def test_nothing_is_printed():
    code = "from sainet.engines.bullet.world import World; World(); print('{}')"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout == "{}\n"
    assert not done.stderr


def in_a_row(disks):
    scene = make_scene([[1.0] * disks], [[0.05] * disks])
    place = np.stack([0.2 * np.arange(disks), np.zeros(disks)], axis=-1)
    start = moving(place[None], np.full((1, disks, 2), 0.05), np.zeros((1, disks)))
    return scene, start, far_away(1, 4)


def test_thirty_disks_slide_and_one_more_is_refused():
    final = roll_out(make_engine("bullet"), *in_a_row(30)).final
    moved = np.asarray(final.position)[0] - [[0.2 * i, 0] for i in range(30)]
    np.testing.assert_allclose(
        moved, np.broadcast_to(moved[:1], moved.shape), atol=1e-6
    )
    assert moved.min() > 1e-4
    with pytest.raises(BadScene, match="has 31 disks; Bullet supports at most 30"):
        roll_out(make_engine("bullet"), *in_a_row(31))
