"""The film of an episode."""

import sys

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from report.samples import lost_record, record, refused_record
from sainet.report.episode_frames import EpisodeFrames
from sainet.report.figures import video
from sainet.report.figures.video import (
    best_format,
    draw_frames,
    frame_count,
    write_film,
)
from sainet.runs.errors import MissingExtra


@pytest.fixture(scope="module")
def pictures():
    return list(draw_frames(record()))


def test_an_animation_shows_every_frame_and_then_holds(pictures):
    shown = len(EpisodeFrames(record()).poses)
    assert len(pictures) == frame_count(record()) > shown
    assert {picture.shape for picture in pictures} == {(544, 960, 3)}
    changes = [np.any(a != b) for a, b in zip(pictures, pictures[1:], strict=False)]
    assert all(changes[: shown - 1])
    assert not any(changes[shown - 1 :])


@pytest.mark.parametrize("odd", [lost_record(), refused_record()])
def test_an_animation_continues_after_nan_and_a_refused_push(odd):
    assert len(list(draw_frames(odd))) == frame_count(odd)


@pytest.mark.parametrize("pushes", [0, 1])
def test_short_episodes_have_animations(pushes, tmp_path):
    short = record(pushes=pushes)
    with Image.open(write_film(short, tmp_path / "a.gif")) as film:
        assert film.n_frames >= 1  # equal pictures are joined
        assert film.size == (960, 544)


def test_both_formats_have_the_duration_of_the_episode(tmp_path):
    told = []
    gif = write_film(record(), tmp_path / "a.gif", on_frame=lambda: told.append(1))
    assert len(told) == frame_count(record())
    with Image.open(gif) as film:
        durations = []
        for index in range(film.n_frames):
            film.seek(index)
            durations.append(film.info["duration"])
    seconds = frame_count(record()) / 30
    assert sum(durations) / 1000 == pytest.approx(seconds, abs=0.1)
    mp4 = write_film(record(), tmp_path / "a.mp4")
    frames, lasts = imageio_ffmpeg.count_frames_and_secs(str(mp4))
    assert frames == frame_count(record())
    assert lasts == pytest.approx(seconds, abs=0.1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.gif", "a.mp4"]


def test_without_the_extra_mp4_names_it(tmp_path, monkeypatch):
    assert best_format() == ".mp4"
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert best_format() == ".gif"
    with pytest.raises(MissingExtra, match=r"pip install 'sainet\[video\]'"):
        write_film(record(), tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())


def test_a_failed_animation_leaves_no_file(tmp_path, monkeypatch):
    def broken(frames, path):
        path.write_bytes(b"half")
        raise RuntimeError("no more")

    monkeypatch.setattr(video, "_write_gif", broken)
    with pytest.raises(RuntimeError, match="no more"):
        write_film(record(), tmp_path / "a.gif")
    assert not list(tmp_path.iterdir())
