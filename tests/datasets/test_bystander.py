"""Bystanders, compared with an engine on the same scene."""

import json

import numpy as np
import pytest
from msgspec import structs

from learning.stores import info_of, made_up, write
from sainet.cli.entry import run
from sainet.datasets import bystander
from sainet.datasets.batch import (
    from_trajectory,
    simulate,
    to_controls,
    to_initial,
    to_scene,
)
from sainet.datasets.bystander import FARTHEST, add_bystander, with_bystander
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.datasets.schema import variables
from sainet.datasets.store import open_store
from sainet.engines import make_engine
from sainet.engines.base import roll_out
from sainet.engines.simulator import simulator_named
from sainet.models.inputs import push_frame
from sainet.runs.errors import BadStore

PUSHES = 48


@pytest.fixture(scope="module", params=["robot", "direct-force"])
def store(request, tmp_path_factory):
    config = GenerateConfig(
        setup=request.param,
        pushes=PUSHES,
        chunk_size=16,
        hold_steps=32,
        force_steps=80,
        noise_level="none",
        assumed_engine=("planar", "planar-true"),
    )
    return generate(config, tmp_path_factory.mktemp("bystander") / request.param)


@pytest.fixture(scope="module")
def wider(store, tmp_path_factory):
    return add_bystander(store, tmp_path_factory.mktemp("wider") / "data")


def gaps(wider):
    """From the bystander to each of the others: push, time, body (m)."""
    arrays = wider.read(slice(None))
    path = np.concatenate([arrays["initial"][:, None], arrays["truth"]], 1)[..., :2]
    apart = np.linalg.norm(path[:, :, :-1] - path[:, :, -1:], axis=-1)
    return apart - (arrays["radius"][:, :-1] + arrays["radius"][:, -1:])[:, None]


def test_the_true_engine_does_not_move_the_bystander(wider):
    arrays, info = wider.read(slice(None)), wider.info
    trajectory = roll_out(
        make_engine(info.engine),
        to_scene(arrays, info),
        to_initial(arrays),
        to_controls(arrays, info),
    )
    found, pusher = from_trajectory(trajectory)
    wrong = np.abs(found[..., :3] - arrays["truth"][..., :3]).max((0, 1))
    assert wrong[:, :2].max() < 2e-5  # m; some begin in touch
    assert wrong[:, 2].max() < 5e-4  # rad
    assert np.abs(pusher - arrays["truth_pusher"]).max() < 2e-5


def test_the_pushes_are_unchanged(store, wider):
    before, after = store.read(slice(None)), wider.read(slice(None))
    assert wider.info == structs.replace(store.info, bodies=3)
    for name, variable in variables(store.info).items():
        if name.startswith("simulated_"):
            continue
        axis = variable.dimensions.index("body") if "body" in variable.dimensions else 0
        kept = np.take(after[name], range(before[name].shape[axis]), axis)
        np.testing.assert_array_equal(kept, before[name])
    pushed = [
        np.asarray(push_frame(to_scene(a, s.info), to_initial(a)).pushed)
        for a, s in ((before, store), (after, wider))
    ]
    np.testing.assert_array_equal(pushed[1][:, :2], pushed[0])


def test_the_bystander_stays_near_a_disk_and_often_touches_it(wider):
    arrays = wider.read(slice(None))
    rest = np.broadcast_to(
        arrays["initial"][:, None, 2], arrays["truth"][:, :, 2].shape
    )
    np.testing.assert_array_equal(arrays["truth"][:, :, 2], rest)
    np.testing.assert_array_equal(arrays["measured"][:, :, 2], rest[..., :3])
    found = gaps(wider)
    assert found.min() >= -1e-7
    nearest = found[:, 0].min(-1)
    assert nearest.max() <= FARTHEST + 1e-7
    touching = nearest < 2e-5
    assert 0.25 < touching.mean() < 0.75
    assert np.ptp(nearest[~touching]) > FARTHEST / 2
    # All around, not only where the disks of two-disk pushes are.
    offset = arrays["initial"][:, 2, :2] - arrays["initial"][:, 0, :2]
    angles = np.arctan2(offset[:, 1], offset[:, 0])
    assert (np.abs(angles) > np.pi / 2).mean() > 0.2
    assert (np.abs(angles) < np.pi / 2).mean() > 0.2


def test_the_pusher_pushes_the_same_disk():
    info = info_of(1000, assumed_engines=())
    made = made_up(info)
    # The path of the pusher is made up as well, and goes through disk 1.
    found = with_bystander(made, info, np.random.default_rng(0))
    start, radius = found["initial"][:, :, :2], found["radius"]
    path = np.concatenate([found["initial_pusher"][:, None], found["truth_pusher"]], 1)
    apart = np.linalg.norm(path[:, :, None] - start[:, None], axis=-1) - radius[:, None]
    gaps = apart - found["pusher_radius"][:, None, None]
    assert gaps[:, :, 2].min() >= -1e-7
    assert (gaps[:, 0, 2] > gaps[:, 0, :2].min(-1)).all()
    assert (gaps[:, :, 2].min(-1) < 0.005).any(), "none lay near the pusher"


def test_simulator_predictions_are_computed_again(wider):
    arrays = wider.read(slice(None))
    names = [str(push) for push in range(PUSHES)]
    for engine in wider.info.assumed_engines:
        again = simulate(simulator_named(engine), arrays, wider.info, names)
        np.testing.assert_allclose(again, arrays[f"simulated_{engine}"], atol=2e-6)
    # Wrong radii overlap at the start; true ones do not.
    moved = {
        name: np.abs(arrays[f"simulated_{name}"][:, -1, 2] - arrays["initial"][:, 2])
        for name in wider.info.assumed_engines
    }
    assert moved["planar"][:, :2].max() > 1e-3
    assert moved["planar-true"][:, :2].max() < 2e-5


def test_the_dataset_depends_on_the_seed_and_is_made_once(store, tmp_path, monkeypatch):
    first = add_bystander(store, tmp_path / "one")
    assert add_bystander(store, tmp_path / "again").content == first.content
    assert add_bystander(store, tmp_path / "other", seed=1).content != first.content
    monkeypatch.setattr(bystander, "with_bystander", None)
    assert add_bystander(store, tmp_path / "one").content == first.content


def test_without_room_the_bystander_is_far_away(monkeypatch):
    monkeypatch.setattr(bystander, "_TRIES", 0)
    info = info_of(3, assumed_engines=())
    arrays = made_up(info)
    found = with_bystander(arrays, info, np.random.default_rng(0))
    apart = found["initial"][:, 2, :2] - arrays["initial"][:, 0, :2]
    np.testing.assert_allclose(apart, 1.0, atol=1e-6)


def test_steps_after_the_end_move_nothing(monkeypatch):
    """A push may be shorter than its arrays; what fills them up is no motion."""
    info = info_of(8, assumed_engines=())
    arrays = made_up(info, lengths=np.full(8, 6))
    filled = arrays | {"truth": arrays["truth"].copy()}
    filled["truth"][:, 6:] = np.nan
    drawn = [
        with_bystander(a, info, np.random.default_rng(0))["initial"]
        for a in (arrays, filled)
    ]
    np.testing.assert_array_equal(*drawn)


def test_unknown_paths_are_refused(tmp_path):
    info = info_of(4, assumed_engines=())
    for name, push in (("truth", 2), ("truth_pusher", 1)):
        arrays = made_up(info)
        arrays[name][push, 3] = np.nan
        if name == "truth":
            arrays["pose_observed"][push, 3] = arrays["rate_observed"][push, 3] = 0
        data = write(tmp_path / name, info, arrays)
        says = "truth is unknown at some steps|truth_pusher: push 1: position is nan"
        with pytest.raises(BadStore, match=says):
            add_bystander(data, tmp_path / f"{name}-out")
        assert not (tmp_path / f"{name}-out").exists()


def test_a_disk_too_many_leaves_nothing_behind(tmp_path):
    info = info_of(2, bodies=100, assumed_engines=())
    data = write(tmp_path / "data", info, made_up(info))
    with pytest.raises(BadStore, match=r"has 100 disks, the most; give one of fewer"):
        add_bystander(data, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_command_reports_its_output_and_refuses_other_folders(
    store, tmp_path, capsys
):
    out = tmp_path / "out"
    words = ["add-bystander", "--data", str(store.path), "--out", str(out)]
    assert run([*words, "--json"]) == 0
    said = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert said == {"out": str(out), "pushes": PUSHES, "disks": 3}
    assert open_store(out).info.bodies == 3
    for more, names in (
        (["--seed", "1"], "bystander_seed"),
        (["--seed", "-1"], "--seed"),
        (["--data", str(tmp_path / "nothing")], "nothing"),
    ):
        assert run([*words, *more]) == 2
        assert names in capsys.readouterr().err
