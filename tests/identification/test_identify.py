"""Identification recovers true parameters and reports unidentifiable ones."""

import json
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from msgspec import structs

from learning.stores import end_points_alone, info_of, made_up, write
from sainet.datasets.batch import from_trajectory, to_controls, to_initial, to_scene
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.datasets.store import open_store
from sainet.datasets.writer import write_store
from sainet.engines.planar.engine import PlanarEngine
from sainet.engines.simulator import BulletSpec
from sainet.identification import residuals as intervals_module
from sainet.identification.identify import identify, identify_into
from sainet.identification.parameters import (
    doubt,
    from_coordinate,
    names_for,
    starting_values,
    to_coordinate,
    to_engine,
    with_values,
)
from sainet.identification.residuals import (
    Scale,
    _looks,
    intervals,
    pose_errors,
    residuals,
    samples,
    slopes,
)
from sainet.models.card import IDENTIFIED, read_identified
from sainet.models.library import find_internal_engine, load_model
from sainet.runs.errors import BadInput, BadStore, RunConflict
from support import write_sealed

OFFSET = {"camera_x_mm": 0.8, "camera_y_mm": -0.5}
TRUE = {"pusher_friction": 0.17, "pressure_radius_ratio": 0.5, **OFFSET}
STROKES = GenerateConfig(
    disks=1,
    pushes=24,
    chunk_size=24,
    stroke_mm=(10.0,),
    speed_mm_s=(10.0,),  # so slowly that inertia, and with it the table, is not felt
    direction_deg=50.0,
    hold_steps=4,
    noise_level="none",
)


def recorded(folder, config, true):
    """Return final poses of pushes with true values; their store assumes others."""
    made = generate(config, folder / "made")
    arrays, info = made.read(slice(None)), made.info
    friction = np.full(info.pushes, 0.25, np.float32)
    arrays |= {"pusher_friction": friction, "disk_friction": friction}
    arrays |= {"table_friction": np.full(info.pushes, 0.15, np.float32)}
    scene, engine = with_values(
        to_scene(arrays, info), {k: jnp.float32(v) for k, v in true.items()}
    )
    offset = jnp.array([true[name] for name in OFFSET]) / 1000
    initial = to_initial(arrays).with_pusher_moved(offset)
    controls = to_controls(arrays, info).moved(offset)
    motion, _ = from_trajectory(
        eqx.filter_jit(engine.rollout)(scene, initial, controls)
    )
    noise = np.random.default_rng(0).normal(size=(*motion.shape[:3], 3))
    motion = motion.copy()
    motion[..., :3] += noise * [1e-4, 1e-4, 2e-3]
    arrays |= {"truth": motion, "measured": motion[..., :3]}
    seen = end_points_alone(arrays)
    seen["measured"] = np.where(
        seen["pose_observed"][..., None, None], motion[..., :3], np.nan
    )
    info = structs.replace(info, engine="recorded")
    (folder / "data").mkdir()
    write_store(folder / "data", info, seen)
    return open_store(folder / "data")


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("identify"), STROKES, TRUE)


@pytest.fixture(scope="module")
def found(store):
    return identify(store)


def test_intervals_contain_the_true_values(found):
    for estimate in found.estimates:
        if estimate.name in TRUE:
            true = TRUE[estimate.name]
            assert estimate.doubt is None
            assert estimate.value == pytest.approx(true, rel=0.05)
            assert estimate.low < true < estimate.high
            widest = 0.2 if estimate.name in OFFSET else 0.3 * true
            assert estimate.high - estimate.low < widest
    assert found.pushes == 24
    assert found.after_mm < 0.5 * found.before_mm
    assert found.after_deg < 0.7 * found.before_deg


@pytest.mark.parametrize("repeats", [1, 4])
def test_intervals_of_a_linear_problem_are_those_of_a_normal_mean(
    store, monkeypatch, repeats
):
    """Each end leaves out 2.5 percent: 1.96 standard errors from the estimate."""
    pushes = 400 // repeats
    drawn = 0.01 * np.random.default_rng(0).normal(size=(pushes, 1))  # mm
    wrong_by = drawn.repeat(repeats, axis=0)

    def residuals(at, scale, part):
        return at["camera_x_mm"] - wrong_by

    monkeypatch.setattr(intervals_module, "residuals", residuals)
    monkeypatch.setattr(
        intervals_module, "slopes", lambda *problem: np.ones((400, 1, 1))
    )
    mean, error = drawn.mean(), drawn.std() / np.sqrt(pushes)
    sample = of_kinds(samples(store)[0], np.arange(400) // repeats)
    problem = ["camera_x_mm"], Scale(1, 1), [sample]
    for value in (mean, mean + 3 * error):  # a step leads to the solution
        found = intervals({"camera_x_mm": value}, *problem)
        ends = (np.array(found["camera_x_mm"]) - mean) / error
        np.testing.assert_allclose(ends, [-1.96, 1.96], atol=0.12)
    wrong_by += 5  # mm: the end of the search range
    assert intervals({"camera_x_mm": mean + 5}, *problem)["camera_x_mm"][1] == 5.0


def of_kinds(part, kinds):
    return replace(part, kinds=kinds, steps=np.zeros((len(kinds), 1), int))


def test_pushes_stored_twice_do_not_narrow_intervals(store, found, tmp_path):
    arrays = {n: np.tile(a, (2, *[1] * (a.ndim - 1))) for n, a in whole(store).items()}
    write_store(tmp_path, structs.replace(store.info, pushes=48), arrays)
    twice = {each.name: each for each in identify(open_store(tmp_path)).estimates}
    for once in found.estimates:
        again = twice[once.name]
        assert again.doubt == once.doubt
        if not once.doubt:
            known = again.value, again.low, again.high
            assert known == pytest.approx((once.value, once.low, once.high), rel=0.02)


def whole(store):
    return {name: np.array(value) for name, value in store.read(slice(None)).items()}


CAMERA = {"camera_x_mm": 0.3, "camera_y_mm": -0.2}


@pytest.fixture
def part(store):
    return samples(store)[0]


def intervals_of(part, monkeypatch, errors, slope):
    monkeypatch.setattr(intervals_module, "residuals", lambda *problem: errors)
    monkeypatch.setattr(intervals_module, "slopes", lambda *problem: slope)
    part = of_kinds(part, np.arange(len(errors)))
    found = intervals(CAMERA, list(CAMERA), Scale(1, 1), [part])
    return np.array([found[name] for name in CAMERA])


def test_intervals_are_those_of_a_loop_over_resamples(part, monkeypatch):
    """Large errors count less, as in the soft l1 loss."""
    rng = np.random.default_rng(1)
    errors, slope = rng.normal(0.1, 1, (30, 5)), rng.normal(2, 1, (30, 5, 2))
    errors[:3] *= 20
    draws = []
    for _ in range(4000):
        chosen = rng.integers(30, size=30)
        error, matrix = errors[chosen].ravel(), slope[chosen].reshape(-1, 2)
        weight = (1 + error**2) ** -0.25
        step = np.linalg.lstsq(weight[:, None] * matrix, weight * error)[0]
        draws.append([*CAMERA.values()] - step)
    wanted = np.percentile(draws, [2.5, 97.5], axis=0).T
    found = intervals_of(part, monkeypatch, errors, slope)
    np.testing.assert_allclose(found, wanted, atol=0.08 * np.ptp(wanted, axis=1).min())


@pytest.mark.parametrize("pushes", [0, 3, 4])
def test_a_parameter_is_identifiable_from_four_pushes_on(part, monkeypatch, pushes):
    rng = np.random.default_rng(0)
    slope = rng.normal(2, 1, (20, 5, 2))
    slope[pushes:, :, 1] = 0
    one, two = intervals_of(part, monkeypatch, rng.normal(size=(20, 5)), slope)
    assert one[1] - one[0] < 1
    assert (two == [-5, 5]).all() == (pushes < 4)
    unknown = intervals_of(part, monkeypatch, np.ones((20, 5)), 0 * slope)
    assert (unknown == [-5, 5]).all()


def test_errors_are_predicted_minus_observed_poses_over_their_scale(part):
    part = replace(part, steps=np.repeat(part.steps, 4, axis=1))
    scale = Scale(1e-3, 1e-2)
    at = {"pusher_friction": np.log(0.2), "camera_x_mm": 0.8}
    batch, offset = part.batch, jnp.array([8e-4, 0.0])
    scene = replace(batch.scene, pusher_friction=jnp.full(batch.size, 0.2))
    moved = batch.initial.with_pusher_moved(offset), batch.controls.moved(offset)
    pose = eqx.filter_jit(PlanarEngine().rollout)(scene, *moved).states.pose
    found = residuals(at, scale, part).reshape(batch.size, -1, 1, 3)
    for push, looks in enumerate(part.steps):
        off = np.asarray(pose[push] - batch.measured[push])[looks]
        wanted = off / [1e-3, 1e-3, 1e-2] / np.sqrt(len(looks))
        np.testing.assert_allclose(found[push], wanted, atol=1e-4)


def test_compared_poses_are_evenly_spaced_and_end_with_the_last_one():
    observed = np.zeros((3, 20), bool)
    observed[0, 2:18] = observed[1, [4, 9, 15]] = observed[2, 19] = True
    found = _looks(observed)
    np.testing.assert_array_equal(found[0], np.arange(3, 18, 2))
    np.testing.assert_array_equal(found[1], [4, 4, 9, 9, 9, 15, 15, 15])
    np.testing.assert_array_equal(found[2], [19] * 8)
    assert _looks(observed[1:]).shape == (2, 3)


def test_every_observed_push_is_in_one_sample(tmp_path):
    """A sample has at most 256 pushes; pushes that were never observed are in none."""
    info = info_of(300, chunk_size=100)
    arrays = made_up(info)
    arrays["mass"][:, 0] = 0.1 * (1 + np.arange(300))
    arrays["pose_observed"][::10] = False
    parts = samples(write(tmp_path / "data", info, arrays))
    assert max(len(part.steps) for part in parts) <= 256
    found = np.concatenate([part.batch.scene.mass[:, 0] for part in parts])
    wanted = np.delete(arrays["mass"][:, 0], np.arange(0, 300, 10))
    np.testing.assert_allclose(found, wanted, rtol=1e-6)


def test_unidentifiable_parameters_keep_their_initial_values(found):
    (table,) = [e for e in found.estimates if e.name == "table_friction"]
    # A pushed disk goes the same way on any table, as long as it does not coast.
    assert table.doubt is not None
    assert table.value == table.start == pytest.approx(0.15)


def test_initial_values_that_pushes_contradict_are_not_kept(tmp_path):
    """Where no push slips, friction may be high, but not the initial value of 0.25."""
    true = {"pusher_friction": 0.6, "pressure_radius_ratio": 0.8, **OFFSET}
    config = replace(STROKES, direction_deg=42.0)
    found = {e.name: e for e in identify(recorded(tmp_path, config, true)).estimates}
    friction = found["pusher_friction"]
    assert friction.high > 3 * friction.low  # vague
    assert friction.doubt is None
    assert friction.value > 0.3
    assert found["table_friction"].value == found["table_friction"].start
    for name in true.keys() - {"pusher_friction"}:
        assert found[name].low < true[name] < found[name].high


@pytest.fixture(scope="module")
def apart(tmp_path_factory):
    """Pushes of two disks that end before disk 1 comes to disk 2."""
    config = replace(
        STROKES,
        disks=2,
        pushes=8,
        chunk_size=8,
        gap_mm=3.0,
        stroke_mm=(5.0,),
        speed_mm_s=(50.0,),
        noise_level="default",
    )
    return generate(config, tmp_path_factory.mktemp("apart") / "data")


def test_parameters_without_effect_keep_their_initial_values(apart):
    found = {estimate.name: estimate for estimate in identify(apart).estimates}
    between = found["disk_friction"]
    assert "too few pushes depend on it" in between.doubt
    assert between.value == between.start == 0.25
    assert (between.low, between.high) == (0.01, 2.0)
    assert not any(found[name].doubt for name in OFFSET)


def test_fewer_than_four_pushes_identify_nothing(apart):
    for estimate in identify(apart.first(3)).estimates:
        assert "too few pushes depend on it" in estimate.doubt
        assert estimate.value == estimate.start


def test_one_disk_has_no_disk_friction(store):
    scene = samples(store)[0].batch.scene
    assert "disk_friction" not in names_for(scene)


def test_slopes_are_those_of_finite_differences(store):
    part, scale = samples(store)[0], Scale(1e-3, 1e-2)
    at = {name: to_coordinate(name, value) for name, value in TRUE.items()}
    slope = slopes(at, list(at), scale, part)
    for index, name in enumerate(at):
        sides = [
            residuals(at | {name: at[name] + step}, scale, part)
            for step in (-0.01, 0.01)
        ]
        numeric = (sides[1] - sides[0]) / 0.02
        close = np.abs(numeric - slope[..., index]) < 0.05 * np.abs(numeric).max()
        assert close.mean() > 0.9  # contact has kinks


def test_the_folder_is_accepted_as_a_model(store, tmp_path):
    out, tried = tmp_path / "mine", []
    result = identify_into(store, out, on_try=tried.append)
    assert tried[-1] < tried[0]
    assert read_identified(out) == result
    model = load_model(str(out))
    assert model.name == "mine"
    values = result.values
    offset = np.array([values["camera_x_mm"], values["camera_y_mm"]]) / 1000
    np.testing.assert_allclose(model.dynamics.offset.vector, offset)
    engine = model.dynamics.dynamics.engine
    assert engine.assumptions.pusher_friction == values["pusher_friction"]
    assert isinstance(engine.engine, PlanarEngine)
    with pytest.raises(BadInput, match="of the planar engine, not of bullet"):
        load_model(str(out), engine="bullet")
    before = (out / IDENTIFIED).stat().st_mtime_ns
    assert identify_into(store, out) == result
    assert (out / IDENTIFIED).stat().st_mtime_ns == before
    with pytest.raises(RunConflict, match="data is"):
        identify_into(store.first(5), out)
    (out / IDENTIFIED).write_text("{}")
    with pytest.raises(BadInput, match=f"{IDENTIFIED}: .*missing.* Delete {out}, then"):
        identify_into(store, out)
    (out / IDENTIFIED).unlink()  # as if it had been interrupted
    for use in (load_model, find_internal_engine):
        with pytest.raises(
            BadInput, match=f"{IDENTIFIED}: missing, so .* 'sainet identify'"
        ):
            use(str(out))


def found_with(*, friction=0.3, ratio=0.5, camera=None, pushes=3, engine=None) -> str:
    """A document of identified parameters."""
    simulator = {
        "engine": "planar",
        "assumptions": {"pusher_friction": friction},
        "pressure_radius_ratio": ratio,
    }
    errors = dict.fromkeys(("before_mm", "after_mm", "before_deg", "after_deg"), 1.0)
    known = engine or {"simulator": simulator, "camera": camera or {}}
    return json.dumps(
        {"engine": known, "estimates": [], "pushes": pushes, "format_version": 2}
        | errors
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{}", "missing required field"),
        (found_with(), None),
        (found_with(engine={"simulator": {"engine": "pinball"}}), "engine"),
        (found_with(ratio=0), "pressure_radius_ratio"),
        (found_with(ratio=50), "pressure_radius_ratio"),
        (found_with(friction=-1), "pusher_friction"),
        (found_with(friction=True), "pusher_friction"),
        (found_with(friction=1e30), "pusher_friction"),
        (found_with(friction="%s"), "pusher_friction"),
        (found_with(camera={"x": "a"}), "camera"),
        (found_with(camera={"x": 3.0}), "camera"),
        (found_with(pushes="many"), "pushes"),
        ("{", "truncated"),
    ],
)
def test_a_damaged_file_is_named(tmp_path, text, says):
    (tmp_path / IDENTIFIED).write_text(text.replace('"%s"', "1" + "0" * 400))
    if says is None:
        with pytest.raises(BadInput, match="seal: missing"):
            read_identified(tmp_path)
        write_sealed(tmp_path / IDENTIFIED, json.loads(text))
        read_identified(tmp_path)
        return
    with pytest.raises(BadInput, match=rf"{IDENTIFIED}: .*{says}.* Delete ") as raised:
        read_identified(tmp_path)
    assert "\n" not in str(raised.value)
    assert len(str(raised.value)) < 600


@pytest.mark.parametrize(
    ("name", "value", "low", "high", "says"),
    [
        ("pusher_friction", 0.2, 0.1, 0.25, None),
        ("pusher_friction", 0.2, 0.05, 0.25, "anything from 0.05 to 0.25"),
        ("pusher_friction", 1.99, 1.5, 2.0, "it is at the edge of the search range"),
        ("pressure_radius_ratio", 0.1, 0.1, 0.11, "the edge of the search range"),
        ("camera_x_mm", 0.0, -0.2, 0.2, None),
        ("camera_x_mm", -1.0, -2.2, 0.2, "anything from -2.2 to 0.2"),
        ("camera_y_mm", -4.99, -5.0, -4.0, "search range, -5 to 5"),
    ],
)
def test_a_wide_interval_is_not_identifiable(name, value, low, high, says):
    found = doubt(name, value, low, high)
    assert (says in found) if says else found is None
    assert from_coordinate(name, to_coordinate(name, value)) == pytest.approx(value)


def test_a_parameter_without_a_slope_is_not_said_to_fit_everywhere():
    """Where no contact slips, a larger friction changes nothing; a low one does."""
    assert doubt("pusher_friction", 0.3, 0.01, 2.0) == "too few pushes depend on it"


def test_scenes_without_friction_are_refused_without_output(store, tmp_path):
    arrays = store.read(slice(None)) | {"table_friction": np.zeros(24, np.float32)}
    slippery = write(tmp_path / "data", store.info, arrays)
    with pytest.raises(BadStore, match="table_friction is 0; .* with a positive one"):
        identify_into(slippery, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_other_parameters_are_those_of_the_scene():
    engine = to_engine({"pusher_friction": 0.3}).simulator.build()
    scene = with_values(samples_scene(), {})[0]
    believed = engine.assume(scene)
    np.testing.assert_allclose(believed.pusher_friction, 0.3)
    for name in ("mass", "radius", "table_friction", "disk_friction"):
        np.testing.assert_array_equal(getattr(believed, name), getattr(scene, name))


def samples_scene():
    info = info_of(3)
    return to_scene(made_up(info), info)


def test_unobserved_and_force_driven_pushes_are_refused(tmp_path):
    info = info_of(3)
    arrays = made_up(info)
    blind = arrays | {"pose_observed": 0 * arrays["pose_observed"]}
    with pytest.raises(BadStore, match="no pose was observed"):
        identify_into(write(tmp_path / "blind", info, blind), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_pushes_of_all_lengths_have_equal_weight(tmp_path, caplog):
    """Short pushes have only observed final poses, long pushes all steps."""
    info = info_of(8, bodies=1)
    arrays = made_up(info, lengths=[8] * 4 + [12] * 4)
    arrays["pose_observed"][:4, :7] = False
    arrays["table_friction"] = np.repeat([0.1, 0.3], 4)
    found = identify(write(tmp_path / "data", info, arrays))
    (table,) = [e for e in found.estimates if e.name == "table_friction"]
    assert table.start == pytest.approx(0.2)
    assert "table_friction varies between pushes, 0.1 to 0.3" in caplog.text
    assert caplog.text.count("varies") == 1
    assert found.pushes == 8
    assert found.before_mm > 0


def test_pushes_of_many_lengths_share_two_programs(tmp_path):
    """Each would take seconds to compile; what follows the end of a push is unseen."""
    arrays = made_up(info_of(9, bodies=1), lengths=[5, 6, 7, 8, 9, 10, 11, 12, 12])
    store = write(tmp_path / "data", info_of(9, bodies=1), arrays)
    parts = samples(store)
    shapes = [part.inputs[0].measured.shape[:2] for part in parts]
    assert shapes == [(2, 6), (7, 12)]
    at = {name: jnp.float32(0.2) for name in ("pusher_friction", "table_friction")}
    found = np.concatenate([pose_errors(at, *part.inputs)[:, -1] for part in parts])
    for push in range(9):
        (alone,) = samples(store.take([push]))
        assert alone.batch.measured.shape[1] == arrays["steps"][push]
        (end,) = pose_errors(at, *alone.inputs)[:, -1]
        np.testing.assert_allclose(found[push], end, atol=1e-7)


def test_rows_that_repeat_pushes_count_once(tmp_path):
    store = write(tmp_path / "data", info_of(9), made_up(info_of(9)))
    (part,) = samples(store)
    assert part.inputs[0].measured.shape[0] == 10
    at = {"pusher_friction": np.log(0.2)}
    scale = Scale(1.0, 1.0)
    assert residuals(at, scale, part).shape[0] == 9
    assert slopes(at, tuple(at), scale, part).shape[0] == 9


def test_equal_frictions_are_exactly_the_initial_value():
    friction = jnp.full(256, 0.15, jnp.float32)  # whose mean rounds to another number
    scenes = [eqx.tree_at(lambda s: s.table_friction, samples_scene(), friction)]
    one, more = (starting_values(scenes * n, ("table_friction",)) for n in (1, 3))
    assert one == more == {"table_friction": float(jnp.mean(friction))}
    lower = eqx.tree_at(lambda s: s.table_friction, scenes[0], friction[:64] - 0.1)
    both = starting_values([*scenes, lower], ("table_friction",))
    assert both["table_friction"] == pytest.approx((256 * 0.15 + 64 * 0.05) / 320)


def test_an_unknown_group_lists_the_available_groups(tmp_path):
    info = info_of(4, groups=("abs-10", "wood", "abs-20"))
    arrays = made_up(info) | {"group": np.array([0, 1, 1, 2])}
    store = write(tmp_path / "data", info, arrays)
    assert store.of_group("wood").rows == (1, 2)
    assert store.of_group("abs").rows == (0, 3)  # a surface
    assert store.of_group("abs-20").rows == (3,)
    with pytest.raises(BadInput, match="no group 'ice'; it has abs-10, wood, abs-20"):
        store.of_group("ice")


def test_an_engine_without_derivatives_leaves_no_folder(store, tmp_path):
    with pytest.raises(BadInput, match="bullet, which has no derivatives"):
        identify_into(store, tmp_path / "out", simulator=BulletSpec())
    assert not (tmp_path / "out").exists()
