"""Inspection: facts by other means, and doubts about pushes that contradict physics."""

import json
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from markupsafe import escape
from msgspec import structs

from datasets.stores import contents, small
from learning.stores import end_points_alone, info_of, made_up, write
from sainet.cli.entry import run
from sainet.datasets.chains import linked
from sainet.datasets.doubts import find_doubts
from sainet.datasets.facts import facts_of
from sainet.datasets.generate import generate
from sainet.datasets.inspection import inspect, starts_where_another_ends
from sainet.datasets.store import Store, open_store
from sainet.report.figures.recordings import draw_histograms

PUSHES, STEPS = 12, 40
RADIUS, PUSHER = 0.05, 0.005  # m
STROKE = 0.02  # m
START = -RADIUS - PUSHER - 0.004  # of the pusher, along x: a gap of 4 mm


def frictionless_line() -> dict[str, np.ndarray]:
    """Pushes along x through the centre of one disk, each at a place of its own.

    The disk rests until the pusher touches it, then moves with it.
    """
    info = info_of(PUSHES, bodies=1, steps=STEPS, engine="recorded", seed=None)
    arrays = made_up(info)
    centre = np.stack([0.3 + 0.01 * np.arange(PUSHES), np.zeros(PUSHES)], axis=-1)
    arrays["initial"] = np.zeros((PUSHES, 1, 6))
    arrays["initial"][:, 0, :2] = centre
    arrays["table_friction"] = np.full(PUSHES, 0.3)
    arrays["radius"][:], arrays["pusher_radius"] = RADIUS, np.full(PUSHES, PUSHER)
    along = np.stack([np.linspace(0, STROKE, STEPS + 1)[1:], np.zeros(STEPS)], axis=-1)
    arrays["initial_pusher"] = centre + [START, 0]
    arrays["truth_pusher"] = arrays["initial_pusher"][:, None] + along
    arrays["command_position"] = arrays["truth_pusher"].copy()
    arrays["truth"] = np.zeros((PUSHES, STEPS, 1, 6))
    arrays["truth"][..., 0, :2] = centre[:, None] + np.maximum(along - [0.004, 0], 0)
    return arrays


def stored(folder: Path, arrays: dict[str, np.ndarray], **changes) -> Store:
    info = info_of(PUSHES, bodies=1, steps=STEPS, engine="recorded", seed=None)
    return write(folder, structs.replace(info, **changes), arrays)


def test_facts_are_those_of_the_construction(tmp_path: Path):
    facts = facts_of(stored(tmp_path / "data", frictionless_line()))
    for name, wanted in {
        **{"stroke": STROKE, "path_length": STROKE, "unseen": 0, "direction": 0},
        **{"contact_angle": 0, "moved": STROKE - 0.004, "turned": 0, "overlap": 0},
        **{"gap": 0.004 - STROKE, "start_overlap": -0.004},
        **{"top_speed": STROKE * 240 / STEPS, "duration": STEPS / 240},
        **{"known_steps": STEPS},
    }.items():
        found = getattr(facts, name)
        np.testing.assert_allclose(found, wanted, atol=1e-6, err_msg=name, rtol=1e-3)


def test_rounding_is_drawn_as_no_variation(tmp_path: Path):
    noise = np.array([1.0, 1 + 1e-6])
    drawn = {"mass": 0.9 * noise, "stroke": 2e4 * noise, "turn": 1e-7 * noise}
    given = {name: ("", values) for name, values in drawn.items()}
    given |= {"speed": ("mm/s", np.array([10.0, 10.1]))}
    text = draw_histograms(given, tmp_path / "a.svg").read_text()
    assert "speed (mm/s)" in text
    assert not [name for name in drawn if f">{name}<" in text]


@pytest.mark.parametrize("wait", [0, 7])
def test_the_time_of_a_stroke_is_the_part_in_which_the_pusher_moves(tmp_path, wait):
    arrays = frictionless_line()
    share = np.clip((np.arange(1, STEPS + 1) - wait) / 5, 0, 1)
    arrays["truth_pusher"][..., 0] = arrays["initial_pusher"][:, :1] + STROKE * share
    facts = facts_of(stored(tmp_path / "data", arrays))
    np.testing.assert_allclose(facts.duration, 5 / 240, rtol=1e-3)


def test_a_pusher_that_rests_has_no_speed(tmp_path: Path):
    arrays = frictionless_line()
    arrays["truth_pusher"][:] = arrays["initial_pusher"][:, None]
    facts = facts_of(stored(tmp_path / "data", arrays))
    assert (facts.stroke / facts.duration == 0).all()


def push_in_place(arrays, push):
    arrays["truth"][push, :, 0, :2] = arrays["initial"][push, 0, :2]


def push_far(arrays, push):
    arrays["truth"][push, -1, 0, 0] += 0.05


def push_backwards_in_time(arrays, push):
    arrays["truth"][push] = arrays["truth"][push, ::-1]


def push_turned(arrays, push):
    arrays["truth"][push, :, 0, 2] = np.linspace(0, 1.5, STEPS)


def push_not_observed(arrays, push):
    arrays["pose_observed"][push] = arrays["rate_observed"][push] = False
    arrays["truth"][push] = np.nan


def push_half_observed(arrays, push):
    arrays["pose_observed"][push, 20:] = arrays["rate_observed"][push, 20:] = False
    arrays["truth"][push, 20:] = np.nan


def push_aside(arrays, push):
    for name in ("initial_pusher", "truth_pusher", "command_position"):
        arrays[name][push, ..., 1] += 0.07


def push_into_nothing(arrays, push):
    push_aside(arrays, push)
    push_in_place(arrays, push)


def push_twice(arrays, push):
    for array in arrays.values():
        array[push] = array[push - 1]


def push_at_rest(arrays, push):
    for name in ("truth_pusher", "command_position"):
        arrays[name][push] = arrays["initial_pusher"][push]
    push_in_place(arrays, push)


def push_from_inside(arrays, push):
    for name in ("initial_pusher", "truth_pusher", "command_position"):
        arrays[name][push, ..., 0] += 0.0065


DOUBTS = {
    "pushed through": (push_in_place, "goes 16.0 mm deeper"),
    "moved too far": (push_far, "moves by 66.0 mm, the pusher by 20.0 mm"),
    "overlap": (push_backwards_in_time, "overlap by 16.0 mm"),
    "turned too far": (push_turned, "a rim turns by 75.0 mm"),
    "no known pose": (push_not_observed, "no pose after the start is known"),
    "unknown final pose": (push_half_observed, "moves by 10.0 mm after the last"),
    "moved untouched": (push_aside, "stays 25.1 mm away"),
    "missed": (push_into_nothing, "passes every disk at 25.1 mm"),
    "duplicate": (push_twice, "as push 4"),
    "pusher at rest": (push_at_rest, "moves by 0.0 mm"),
    "overlap at the start": (push_from_inside, "by 2.5 mm at the start"),
}


@pytest.mark.parametrize("reason", DOUBTS)
def test_a_push_that_contradicts_physics_is_named(tmp_path: Path, reason: str):
    spoil, text = DOUBTS[reason]
    arrays = frictionless_line()
    spoil(arrays, 5)
    store = stored(tmp_path / "data", arrays)
    doubts = find_doubts(store, facts_of(store))
    assert {doubt.row for doubt in doubts} == {5}
    assert [text in doubt.text for doubt in doubts if doubt.reason == reason] == [True]


def pushes_beside_the_centre(sense: np.ndarray) -> dict[str, np.ndarray]:
    """Pushes that pass the centre on the right, and turn the disk by 6 degrees."""
    arrays = frictionless_line()
    for name in ("initial_pusher", "truth_pusher", "command_position"):
        arrays[name][..., 1] -= 0.01
    turned = np.linspace(0, np.deg2rad(6), STEPS)
    arrays["truth"][..., 0, 2] = sense[:, None] * turned
    return arrays


@pytest.mark.parametrize(("wrong", "named"), [(PUSHES, PUSHES), (10, 10), (9, 0)])
def test_clockwise_angles_are_doubtful(tmp_path: Path, wrong: int, named: int):
    """Single pushes may turn a disk the other way, for example at other disks."""
    sense = np.where(np.arange(PUSHES) < wrong, -1.0, 1.0)
    store = stored(tmp_path / "data", pushes_beside_the_centre(sense))
    doubts = find_doubts(store, facts_of(store))
    assert [doubt.row for doubt in doubts] == [*range(named)]
    assert all(doubt.reason == "turned the other way" for doubt in doubts)
    assert all("turns by -6.0 degrees" in doubt.text for doubt in doubts)


@pytest.mark.parametrize(
    "settings", [{}, {"disks": 3}, {"setup": "direct-force"}, {"noise_level": "none"}]
)
def test_simulated_pushes_are_never_doubtful(tmp_path: Path, settings):
    """And their geometry is what was drawn."""
    config = small(stroke_mm=(2.5, 15.0), **settings)
    store = generate(config, tmp_path / "data")
    facts = facts_of(store)
    assert find_doubts(store, facts) == []
    widest = np.deg2rad(config.contact_angle_deg)
    assert np.abs(facts.contact_angle).max() <= widest + 0.01
    assert np.ptp(facts.contact_angle) > widest / 2
    assert np.abs(facts.gap + facts.overlap[:, None]).min() >= 0


def test_end_points_have_the_doubts_of_both_ends_alone(tmp_path: Path):
    arrays = frictionless_line()
    push_far(arrays, 2)
    push_in_place(arrays, 3)
    store = stored(tmp_path / "data", end_points_alone(arrays))
    found = inspect(store, facts_of(store))
    assert {(d.row, d.reason) for d in found.doubts} >= {
        (2, "moved too far"),
        (3, "pushed through"),
    }
    assert {doubt.row for doubt in found.doubts} == {2, 3}
    assert found.observed == pytest.approx(1 / STEPS)


def test_chains_are_those_that_comparing_all_pairs_finds(tmp_path: Path):
    rng = np.random.default_rng(3)
    arrays = frictionless_line()
    facts = facts_of(stored(tmp_path / "data", arrays))
    start, end = facts.start.copy(), facts.end.copy()
    for push in range(1, PUSHES):
        apart = rng.uniform(0, 6e-4) * np.array([np.cos(push), np.sin(push)])
        start[push, 0] = [*(end[push - 1, 0, :2] + apart), rng.uniform(0, 0.03)]
    end[4] = np.nan
    wanted = [
        any(
            np.linalg.norm((s - e)[0, :2]) <= 3e-4 and abs((s - e)[0, 2]) <= np.pi / 180
            for other, e in enumerate(end)
            if other != push
        )
        for push, s in enumerate(start)
    ]
    found = starts_where_another_ends(replace(facts, start=start, end=end))
    assert found.tolist() == wanted
    assert 1 < sum(wanted) < PUSHES - 2


def test_a_closed_push_is_no_chain(tmp_path: Path):
    arrays = frictionless_line()
    push_in_place(arrays, 3)
    store = stored(tmp_path / "data", arrays)
    assert not starts_where_another_ends(facts_of(store)).any()
    assert len(set(linked(store))) == PUSHES


def test_groups_repeats_and_ranges_are_counted(tmp_path: Path):
    arrays = frictionless_line() | {"repeat": np.arange(PUSHES) // 5}
    arrays["group"] = np.arange(PUSHES) % 3
    arrays["repeat"][-1] = 77
    store = stored(
        tmp_path / "data", arrays, has_repeats=True, groups=("a", "b", "<i>")
    )
    found = inspect(store, facts_of(store))
    assert found.groups == {"a": 4, "b": 4, "<i>": 4}
    assert found.repeats == PUSHES - 2 + (np.arange(PUSHES)[-2] // 5 == 1)
    ranges = {each.name: each for each in found.ranges}
    assert ranges["stroke"].median == pytest.approx(1000 * STROKE, rel=1e-4)
    assert ranges["mass"].high == PUSHES


def test_the_command_prints_and_writes_one_page(tmp_path: Path, capfd):
    arrays = frictionless_line()
    push_far(arrays, 5)
    arrays["group"] = np.zeros(PUSHES)
    store = stored(tmp_path / "data", arrays, groups=("<script>x",))
    (store.path / "config.json").write_text('{"command": "a test"}')
    page = tmp_path / "my page.html"
    before = contents(store.path)
    assert run(["inspect", str(store.path)]) == 0
    text = capfd.readouterr().out
    assert "12 pushes of 1 disk, recorded" in text
    assert "row 5: moved too far" in text
    assert run(["inspect", str(store.path), "--out", str(page), "--json"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert [doubt["row"] for doubt in found["doubts"]] == [5]
    assert found["page"] == str(page)
    html = page.read_text()
    assert "moved too far" in html
    assert escape(shlex.join(["--out", str(page)])) in html
    assert html.count("<svg") == 2
    assert "<script" not in html
    assert "http" not in html.replace("http://www.w3.org/", "").replace(
        "http-equiv", ""
    )
    assert contents(store.path) == before


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["nowhere"], "nowhere: no such dataset"),
        (["DATA", "--out", "page.txt"], "--out is page.txt; it must be a file that"),
        (["DATA", "--out", "FILE/page.html"], "FILE"),
    ],
)
def test_bad_usage_is_one_line(tmp_path: Path, capfd, words, wanted, whole_store):
    (tmp_path / "FILE").write_text("")
    names = {"DATA": str(whole_store), "FILE/page.html": f"{tmp_path}/FILE/page.html"}
    assert run(["inspect", *(names.get(word, word) for word in words)]) == 2
    error = capfd.readouterr().err
    assert wanted in error
    assert len(error.splitlines()) == 1


@pytest.mark.recorded
def test_recorded_pushes_are_inspected(tmp_path: Path, recorded_pushes_folder: Path):
    """Of the recorded strokes none contradicts physics; many form chains."""
    words = ["import", "mitpush-endpoints", str(recorded_pushes_folder)]
    assert run([*words, "--out", str(tmp_path / "data"), "--quiet"]) == 0
    store = open_store(tmp_path / "data")
    found = inspect(store, facts_of(store))
    assert (found.pushes, found.disks, len(found.groups)) == (805, 1, 3)
    assert found.doubts == ()
    sizes = np.bincount(linked(store))
    assert 200 < found.chained < sizes[sizes > 1].sum()
