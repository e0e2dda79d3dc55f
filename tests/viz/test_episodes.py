"""The figure of episodes."""

from xml.etree import ElementTree

import numpy as np

from sainet.viz.episodes import MOVED, PUSHED, body_paths, draw_episodes


def record(pushes=3, **changes):
    turns = [
        {
            "observed": [[10.0 * push, 0.0, 0.0], [10.0 * push + 113, 0.0, 0.0]],
            "actual": [
                [[10.0 * push + x, 1.0, 2.0], [10.0 * push + 113 + x, 1.0, 2.0]]
                for x in (3.0, 6.0, 9.0)
            ],
        }
        for push in range(pushes)
    ]
    known = {
        "turns": turns,
        "pushes": pushes,
        "moved": 1,
        "solved": True,
        "reason": "solved",
        "final_mm": 2.34,
        "goal_mm": [150.0, 0.0],
        "tolerance_mm": 5.9,
        "radius_mm": [54.0, 59.0],
    }
    return known | changes


def test_a_path_goes_from_the_first_sight_to_the_end():
    path = body_paths(record())
    assert path.shape == (1 + 3 * 3, 2, 3)
    np.testing.assert_array_equal(path[0, :, 0], [0, 113])
    np.testing.assert_array_equal(path[-1, :, 0], [29, 142])
    assert body_paths(record(pushes=0)).shape == (1, 2, 3)


def test_every_episode_has_a_panel_and_hostile_words_are_text(tmp_path):
    bad = "<script>alert(1)</script> $x_{"
    records = [record(), record(pushes=1, solved=False, reason=bad), record(pushes=0)]
    one, two = (draw_episodes(records, tmp_path / f"{n}.svg") for n in "ab")
    assert one.read_bytes() == two.read_bytes()
    assert ElementTree.parse(one).getroot().tag.endswith("svg")
    text = one.read_text()
    assert "<script" not in text
    for said in ("3 pushes, solved, 2.3 mm off", "1 pushes, &lt;script"):
        assert said in text
    assert PUSHED in text
    assert MOVED in text
