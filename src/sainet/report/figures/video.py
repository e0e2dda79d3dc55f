"""Animation of an episode: MP4 with the extra `video`, otherwise GIF."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import closing
from importlib.util import find_spec
from itertools import repeat
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from sainet.control.record import EpisodeRecord
from sainet.report.episode_frames import FRAMES_PER_SECOND, EpisodeFrames, episode_title
from sainet.report.figures.canvas import add_grid, house_look, new_figure
from sainet.report.figures.episodes import body_color
from sainet.report.palette import INK, TARGET
from sainet.runs.documents import atomic_path
from sainet.runs.errors import missing_extra

_PIXELS = (960, 544)  # multiples of 16, as encoders require
_DOTS_PER_INCH = 100
_HOLD = 20  # frames that show the end
_GIF_STRIDE = 2  # a GIF shows every second frame
_FADE = 0.45  # opacity of replaced plans
_PLANS = 4
_MARK = 0.75  # of the radius, from where the mark goes to the rim

Frame = UInt8[np.ndarray, "height width 3"]


def best_format() -> str:
    """Return the suffix of the best format that is available."""
    return ".mp4" if find_spec("imageio_ffmpeg") else ".gif"


def frame_count(record: EpisodeRecord) -> int:
    """Return the number of frames in the animation of an episode."""
    return len(EpisodeFrames(record).poses) + _HOLD


def write_film(
    record: EpisodeRecord, path: Path, *, on_frame: Callable[[], None] = lambda: None
) -> Path:
    """Write the animation of an episode atomically and return its path.

    Args:
        record: record of the episode, from the run folder of `sainet control`.
        path: ends in .mp4 or .gif.
        on_frame: called after each of the `frame_count` frames.

    Raises:
        MissingExtra: the format is MP4 and `imageio-ffmpeg` is not installed.
    """
    frames = _telling(draw_frames(record), on_frame)
    with atomic_path(path) as draft:
        if path.suffix == ".gif":
            _write_gif(frames, draft)
        else:
            _write_mp4(frames, draft)
    return path


def _telling(frames: Iterator[Frame], on_frame: Callable[[], None]) -> Iterator[Frame]:
    for frame in frames:
        yield frame
        on_frame()


def draw_frames(record: EpisodeRecord) -> Iterator[Frame]:
    """Yield the frames of an animation, 30 per second."""
    with house_look():
        stage = _Stage(record)
        last = len(stage.frames.poses) - 1
        yield from map(stage.picture, range(last))
        yield from repeat(stage.picture(last), 1 + _HOLD)


class _Stage:
    """Figure whose disks, plans and curve change from frame to frame."""

    def __init__(self, record: EpisodeRecord) -> None:
        self.record, self.frames = record, EpisodeFrames(record)
        figure = new_figure(*(pixels / _DOTS_PER_INCH for pixels in _PIXELS))
        figure.set_dpi(_DOTS_PER_INCH)
        self._canvas = FigureCanvasAgg(figure)
        self._scene, self._chart = figure.subplots(1, 2, width_ratios=(2.2, 1))
        figure.suptitle(episode_title(record), x=0.01, ha="left", weight="bold")
        self._disks = self._draw_scene()
        self._curve = self._draw_chart()
        self._plans: list[Artist] = []
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # it need not be laid out for each frame

    def picture(self, frame: int) -> Frame:
        """Return the pixels of one frame."""
        self._move_disks(frame)
        self._show_plans(self.frames.turn_at(frame))
        is_last = frame == len(self.frames.poses) - 1
        last = len(self.frames.distances)
        count = last if is_last else self.frames.turn_at(frame) + 1
        self._curve.set_data(range(count), self.frames.distances[:count])
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _draw_scene(self) -> list[tuple[Circle, Line2D, Line2D]]:
        record, scene = self.record, self._scene
        goal = record.goal_mm[0], record.goal_mm[1]
        scene.add_patch(Circle(goal, record.tolerance_mm, color=TARGET, zorder=4))
        start, disks = self.frames.poses[0], []
        for body, radius in enumerate(record.radius_mm):
            color, place = body_color(record, body), start[body, :2]
            ghost = Circle(place, radius, fill=False, ec=(color, 0.4), ls="--")
            disk = Circle(place, radius, fc=(color, 0.3), ec=color, lw=1.5)
            scene.add_patch(ghost)
            scene.add_patch(disk)
            (mark,) = scene.plot([], [], color=color, lw=1.5)
            (trail,) = scene.plot([], [], color=color, lw=1.2)
            disks.append((disk, mark, trail))
        self._pusher = Circle((0, 0), record.pusher_radius_mm, color=INK, zorder=5)
        scene.add_patch(self._pusher)
        places = self.frames.poses[..., :2].reshape(-1, 2)
        reach = max(record.radius_mm) + 12
        low = np.fmin(np.fmin.reduce(places), goal) - reach  # what diverged is NaN
        high = np.fmax(np.fmax.reduce(places), goal) + reach
        scene.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        scene.set(xlabel="x (mm)", ylabel="y (mm)")
        return disks

    def _draw_chart(self):  # noqa: ANN202
        chart, distances = self._chart, self.frames.distances
        chart.axhspan(0, self.record.tolerance_mm, color=TARGET, alpha=0.5, lw=0)
        color = body_color(self.record, self.record.moved)
        # Its last point lies on the edge; that is no reason to make the chart smaller.
        look = {"color": color, "markersize": 3, "clip_on": False, "in_layout": False}
        (curve,) = chart.plot([], [], "o-", **look)
        high = 1.05 * np.fmax.reduce([*distances, self.record.tolerance_mm])
        chart.set(xlim=(0, max(len(distances) - 1, 1)), ylim=(0, high))
        chart.set(xlabel="push", title="Distance from the goal (mm)")
        add_grid(chart)
        return curve

    def _move_disks(self, frame: int) -> None:
        poses = self.frames.poses
        for body, (disk, mark, trail) in enumerate(self._disks):
            x, y, angle = poses[frame, body]
            turned = np.deg2rad(angle)
            reach = disk.radius * np.array([_MARK, 1.0])
            disk.center = x, y
            mark.set_data(x + reach * np.cos(turned), y + reach * np.sin(turned))
            trail.set_data(*poses[: frame + 1, body, :2].T)
        self._pusher.set_visible(bool(np.isfinite(self.frames.pusher[frame]).all()))
        self._pusher.center = tuple(self.frames.pusher[frame])

    def _show_plans(self, now: int) -> None:
        for artist in self._plans:
            artist.remove()
        first = max(now - _PLANS + 1, 0)
        self._plans = [
            line
            for turn in range(first, now + 1)
            for body in range(self.frames.poses.shape[1])
            for line in self._scene.plot(
                *self.frames.plans[turn][:, body].T,
                ":",
                color=INK,
                lw=1.4,
                alpha=_FADE ** (now - turn),
            )
        ]


def _write_gif(frames: Iterator[Frame], path: Path) -> None:
    from PIL import Image

    pictures = [
        Image.fromarray(frame).quantize(64)
        for index, frame in enumerate(frames)
        if index % _GIF_STRIDE == 0
    ]
    pictures[0].save(
        path,
        format="GIF",
        save_all=True,
        append_images=pictures[1:],
        duration=1000 * _GIF_STRIDE // FRAMES_PER_SECOND,
        loop=0,
    )


def _write_mp4(frames: Iterator[Frame], path: Path) -> None:
    try:
        from imageio_ffmpeg import write_frames
    except ImportError:
        needs = "MP4 needs the package imageio-ffmpeg"
        raise missing_extra(needs, "video", "animations are written as .gif") from None
    # FFmpeg does not support the suffix of the temporary file.
    writer = write_frames(
        str(path), _PIXELS, fps=FRAMES_PER_SECOND, output_params=["-f", "mp4"]
    )
    with closing(writer):
        with warnings.catch_warnings():
            # JAX warns of every process that is started; FFmpeg does not use it.
            warnings.filterwarnings("ignore", r"os\.fork", RuntimeWarning)
            writer.send(None)
        for frame in frames:
            writer.send(np.ascontiguousarray(frame))
