"""The page of an evaluation: which pushes it shows, and what it says of them."""

import json
import re
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from learning.stores import end_points_alone, info_of, made_up, write
from sainet.evaluation.evaluate import evaluate
from sainet.models.correctors import Region
from sainet.models.dynamics import AbstractDynamics
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.report.pages import evaluation as page
from sainet.report.pages.evaluation import shown_pushes, write_evaluation
from sainet.report.replays import build_replay, error_curves
from sainet.scenes.state import Trajectory

LENGTHS = np.array([12, 5, 12, 8, 5, 12, 8])
AXES = [[0.004, 0.001], [0.002, 0.003]]


class Drifting(AbstractDynamics):
    """Predicts that everything moves along x, and states one region for all pushes."""

    speed: jax.Array  # m per step
    knows: bool

    @property
    def has_regions(self):
        return self.knows

    def begin(self, scene, state):
        return state

    def advance(self, scene, carry, controls, simulated=None):
        moved = self.speed * jnp.arange(1, controls.steps + 1)[:, None]
        path = jax.tree.map(
            lambda x: jnp.repeat(x[:, None], controls.steps, axis=1), carry
        )
        place = path.position.at[..., 0].add(moved)
        return carry, Trajectory(replace(path, position=place))

    def region(self, scene, state, controls):
        if not self.knows:
            return None
        size = len(state.position)
        wide = jnp.broadcast_to(jnp.array(AXES), (size, 2, 2))
        turn = jnp.full((size, 2), np.deg2rad(2.5))
        return Region(jnp.full(size, 0.3), wide, turn, jnp.ones((size, 2, 2)))


def model(name, speed, *, knows=False):
    return Model(ModelId(kind="in", name=name), Drifting(jnp.float32(speed), knows))


MODELS = (model("slow", 0.0), model("fast", 0.002, knows=True))


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    info = info_of(len(LENGTHS))
    return stored(tmp_path_factory.mktemp("simulated"), info, made_up(info, LENGTHS))


def stored(folder, info, arrays):
    store = write(folder, info, arrays)
    (folder / "config.json").write_text('{"command": "generate"}')
    return store


def final_errors(store, speed):
    """What a drifting model gets wrong at the end of each push, over both disks."""
    arrays = store.read(slice(None))
    found = []
    for push, steps in enumerate(LENGTHS):
        moved = [speed * steps, 0]
        end = arrays["initial"][push, :, :2] + moved
        gap = end - arrays["truth"][push, steps - 1, :, :2]
        found.append(np.linalg.norm(gap, axis=-1).mean())
    return np.array(found)


def test_the_page_shows_a_usual_push_and_the_worst_one(store):
    first, last = shown_pushes(MODELS, evaluate(MODELS, store))
    slow, fast = final_errors(store, 0.0), final_errors(store, 0.002)
    assert first.push == np.argsort(slow)[len(slow) // 2]
    assert last.push == np.argmax(fast)
    row = f"Push {first.push} (counted from 0)"
    assert first.title == f"{row}: the median final error of slow"
    row = f"Push {last.push} (counted from 0)"
    assert last.title == f"{row}: the largest final error of fast"


def test_a_shown_push_is_named_by_its_row_in_the_whole_dataset(store):
    chosen = store.take(range(2, 7))
    for push, title in shown_pushes(MODELS, evaluate(MODELS, chosen)):
        assert title.startswith(f"Push {push + 2} (")


def test_a_replay_has_the_steps_and_the_region_of_its_push(store):
    replay = build_replay(MODELS, store, 1, title="Push 2", steps=12)
    assert len(replay.reference.angle) == 1 + LENGTHS[1]
    moved = replay.tracks["fast"].position - replay.tracks["slow"].position
    drift = 0.002 * np.arange(6)[:, None]
    np.testing.assert_allclose(moved[..., 0], np.repeat(drift, 2, axis=1), atol=1e-6)
    assert replay.tracks["slow"].region is None
    region = replay.tracks["fast"].region
    assert region.heading == pytest.approx(0.3)
    np.testing.assert_allclose(region.axes, AXES, rtol=1e-6)
    np.testing.assert_allclose(np.degrees(region.turn), 2.5, rtol=1e-6)


def test_errors_over_time_are_means_over_the_pushes_that_last(store):
    curves = error_curves(MODELS, store, steps=12, pushes=100)
    arrays = store.read(slice(None))
    for name, speed in (("slow", 0.0), ("fast", 0.002)):
        for step in (0, 6, 11):
            gaps = [
                arrays["initial"][push, :, :2]
                + [speed * (step + 1), 0]
                - arrays["truth"][push, step, :, :2]
                for push in np.flatnonzero(step < LENGTHS)
            ]
            mean = 1000 * np.linalg.norm(gaps, axis=-1).mean(axis=0)
            np.testing.assert_allclose(curves[name][step], mean, rtol=1e-3)


def test_the_page_holds_curves_replays_and_regions(store, tmp_path):
    measured = evaluate(MODELS, store)
    path = tmp_path / "page.html"
    write_evaluation(MODELS, store, measured, path, command="sainet evaluate <x>")
    text = path.read_text()
    assert "<h2>Pushes, replayed</h2>" in text
    assert "An ellipse is where its model" in text
    assert "Mean position error of each disk" in text
    assert "sainet evaluate &lt;x&gt;" in text
    assert "fast: its 90 % regions hold" in text
    found = re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text)
    replays = [json.loads(data) for data in found]
    assert len(replays) == 2
    assert [track["region"] for track in replays[0]["tracks"][:2]] == [None, None]
    assert replays[0]["tracks"][2]["region"] == {
        "heading": 0.3,
        "axes": [[4.0, 1.0], [2.0, 3.0]],
        "turn": [2.5, 2.5],
    }


@pytest.mark.parametrize(
    ("most", "part"), [(3, ", in the first 3 pushes."), (len(LENGTHS), ".")]
)
def test_the_curves_state_of_which_pushes_they_are(
    store, tmp_path, most, part, monkeypatch
):
    monkeypatch.setattr(page, "_MOST_AVERAGED", most)
    path = tmp_path / "page.html"
    measured = evaluate(MODELS, store)
    page.write_evaluation(MODELS, store, measured, path, command="")
    assert f"of each disk over the time of a push{part}" in path.read_text()


def test_a_page_names_a_model_by_its_label_alone(store, tmp_path):
    id = ModelId(kind="gp", features="place")
    models = [Model(id, Drifting(jnp.float32(0.0), True))]
    path = tmp_path / "page.html"
    write_evaluation(models, store, evaluate(models, store), path, command="")
    text = path.read_text()
    assert "gp-place" not in text
    assert f"{id.label}: its 90 % regions hold" in text
    assert text.count(f">{id.label}</text>") == 2  # in the panel of each disk
    assert text.count(f'"label": "{id.label}"') == 2  # in each replay


def test_recorded_ends_need_no_path(tmp_path):
    info = info_of(len(LENGTHS), engine="recorded", seed=None)
    arrays = end_points_alone(made_up(info, LENGTHS))
    store = stored(tmp_path / "recorded", info, arrays)
    measured = evaluate(MODELS[:1], store)
    path = tmp_path / "page.html"
    write_evaluation(MODELS[:1], store, measured, path, command="")
    text = path.read_text()
    assert "Errors of 1 model on" in text
    assert "Mean position error of each disk" not in text
    assert "An ellipse is where its model" not in text
    found = re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text)
    truth = json.loads(found[0])["tracks"][0]["bodies"][0]["x"]
    assert truth[1:-1] == [None] * (len(truth) - 2)
    assert truth[0] is not None
    assert truth[-1] is not None
