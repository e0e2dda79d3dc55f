"""What a model misses of the ends of pushes, with its sign and direction."""

import numpy as np
import pytest

from learning.stores import end_points_alone, info_of, made_up, write
from sainet.evaluation.evaluate import evaluate
from sainet.evaluation.predictions import EndOffsets, end_offsets
from sainet.models.library import load_model
from sainet.report.figures.engine_errors import draw_engine_errors


def test_an_offset_ahead_is_along_and_one_to_the_left_is_across():
    heading = np.deg2rad([0.0, 90.0, 180.0])
    offset = np.array([[1.0, 2.0], [-2.0, 1.0], [-1.0, -2.0]])
    found = EndOffsets(np.zeros((3, 2)), heading, offset, np.zeros(3))
    np.testing.assert_allclose(found.along, 1.0)
    np.testing.assert_allclose(found.across, 2.0)


def test_its_size_is_the_error_of_the_evaluation(tmp_path):
    info = info_of(9, engine="recorded", seed=None, bodies=1)
    arrays = end_points_alone(made_up(info, lengths=[12, 8, 12] * 3))
    store = write(tmp_path / "data", info, arrays)
    model = load_model("physics")
    found, known = end_offsets(model, store), evaluate([model], store)
    size = 1000 * np.hypot(found.along, found.across)
    np.testing.assert_allclose(
        size, known.values("final_pos_mm", "physics").reshape(-1), rtol=1e-4
    )
    turn = np.abs(np.rad2deg(found.turn))
    np.testing.assert_allclose(
        turn, known.values("final_rot_deg", "physics").reshape(-1), rtol=1e-4, atol=1e-4
    )
    np.testing.assert_allclose(found.place, arrays["initial"][:, 0, :2], rtol=1e-6)
    way = arrays["command_position"][0, 11] - arrays["initial_pusher"][0]
    assert found.heading[0] == pytest.approx(np.arctan2(way[1], way[0]), abs=1e-3)


def test_the_figure_shows_each_surface(tmp_path):
    rng = np.random.default_rng(0)
    case = EndOffsets(
        rng.uniform(0, 0.1, (60, 2)),
        rng.uniform(-np.pi, np.pi, 60),
        rng.normal(0, 1e-3, (60, 2)),
        rng.normal(0, 0.1, 60),
    )
    path = draw_engine_errors({"abs": case, "<wood>": case}, tmp_path / "a.svg")
    text = path.read_text()
    for said in ("abs: where on the table", "&lt;wood&gt;: in which direction", "2 mm"):
        assert said in text
