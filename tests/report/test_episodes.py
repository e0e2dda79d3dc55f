"""The figure of episodes."""

import json
from xml.etree import ElementTree

import numpy as np
from msgspec import structs

from report.samples import lost_record, record, refused_record
from sainet.report.episode_frames import EpisodeFrames, episode_data, outcome
from sainet.report.figures.episodes import body_paths, draw_episodes
from sainet.report.pages.page import Report, to_page
from sainet.report.palette import MOVED, PUSHED


def test_a_path_runs_from_the_first_observation_to_the_end():
    path = body_paths(record())
    assert path.shape == (1 + 3 * 3, 2, 3)
    np.testing.assert_array_equal(path[0, :, 0], [0, 113])
    np.testing.assert_array_equal(path[-1, :, 0], [29, 142])
    assert body_paths(record(pushes=0)).shape == (1, 2, 3)


def test_every_episode_has_a_panel_and_hostile_text_is_escaped(tmp_path):
    bad = "<script>alert(1)</script> $x_{"
    failed = record(pushes=1, solved=False, reason=bad)
    records = [record(), failed, record(pushes=0)]
    one, two = (draw_episodes(records, tmp_path / f"{n}.svg") for n in "ab")
    assert one.read_bytes() == two.read_bytes()
    assert ElementTree.parse(one).getroot().tag.endswith("svg")
    text = one.read_text()
    assert "<script" not in text
    for said in ("solved with 3 pushes", "2.3 mm off", "&lt;script"):
        assert said in text
    assert PUSHED in text
    assert MOVED in text


def test_frames_are_the_observations_of_each_push():
    frames = EpisodeFrames(record())
    assert frames.starts == [0, 4, 8]
    assert frames.poses.shape == (3 * 4, 2, 3)
    np.testing.assert_array_equal(frames.poses[4:8, 0, 0], [10, 13, 16, 19])
    assert len(frames.pusher) == len(frames.poses)
    assert [frames.turn_at(frame) for frame in (0, 3, 4, 11)] == [0, 0, 1, 2]
    assert frames.distances == [150.0, 140.0, 130.0, 2.34]
    last = [plan[-1, 1].tolist() for plan in frames.plans]
    assert last == [[10.0 * push + 122, 1.0] for push in range(3)]


def test_an_episode_without_a_push_has_one_frame():
    frames = EpisodeFrames(record(pushes=0))
    assert (len(frames.poses), frames.starts, frames.turn_at(0)) == (1, [], -1)
    data = episode_data(record(pushes=0))
    assert data["steps"] == 0
    assert data["pusher"] == {"x": [None], "y": [None]}
    json.dumps(data, allow_nan=False)


def test_the_outcome_uses_the_true_final_pose():
    assert outcome(record()) == "solved with 3 pushes"
    assert outcome(record(pushes=1)) == "solved with 1 push"
    seen = record(solved=False, reason="solved")
    assert outcome(seen) == "not at the goal after 3 pushes"
    lost = record(solved=False, reason="out of pushes")
    assert outcome(lost) == "out of pushes after 3 pushes"


def test_nan_and_infinity_are_not_drawn(tmp_path):
    records = [lost_record(), structs.replace(lost_record(), steps=[])]
    text = draw_episodes(records, tmp_path / "a.svg").read_text()
    assert "nan" not in text.lower().replace("nance", "")
    for lost in records:
        data = json.loads(json.dumps(episode_data(lost), allow_nan=False))
        assert data["distances"][-1] is None
        assert data["bodies"][0]["x"][-1] is data["bodies"][0]["angle"][-1] is None


def test_a_long_reason_leaves_room_for_the_picture(tmp_path):
    # A title that is wider than its figure collapses the axes; matplotlib warns.
    lost = record(pushes=1, solved=False, reason="the camera saw nothing " * 4)
    assert draw_episodes([lost], tmp_path / "a.png").stat().st_size > 0


def test_details_of_a_reason_stay_in_the_record():
    lost = record(solved=False, reason="out of pushes: the goal was 177 mm away")
    assert outcome(lost) == "out of pushes after 3 pushes"


def test_a_refused_push_has_one_frame_in_figures_and_pages(tmp_path):
    refused = refused_record()
    assert body_paths(refused).shape == (1 + 2 * 3, 2, 3)
    assert draw_episodes([refused], tmp_path / "a.svg").is_file()
    frames = EpisodeFrames(refused)
    assert (frames.starts, len(frames.poses), len(frames.pusher)) == ([0, 4, 5], 9, 9)
    assert np.isnan(frames.pusher[4]).all()
    data = episode_data(refused)
    assert data["turns"][1]["plan"] == 2 * [{"x": [], "y": []}]
    assert "refused" in to_page(Report(title="refused", episodes=[refused]))
