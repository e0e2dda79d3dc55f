"""The figures are written whole, are the same each time, and survive odd input."""

import dataclasses
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from report import samples
from sainet.engines.simulator import SIMULATORS
from sainet.models.identity import ModelId
from sainet.report.episode_frames import Replay, Track
from sainet.report.figures.canvas import spread
from sainet.report.figures.curves import draw_learning_curve, running_mean
from sainet.report.figures.paths import draw_error_over_time, draw_paths
from sainet.report.live.config import PlayConfig
from sainet.report.live.page import assets
from sainet.report.pages import read
from sainet.report.palette import css_variables, labels_of, style_of, styles_of

HOSTILE = "<script>alert(1)</script> $x_{"


def _errors(path):
    return draw_error_over_time(samples.curves(), path, time_step=samples.TIME_STEP)


DRAW = {
    "paths": lambda path: draw_paths(samples.replay(), path),
    "errors": _errors,
    "learning": lambda path: draw_learning_curve(samples.histories(), path),
}


@pytest.mark.parametrize("name", DRAW)
def test_svg_is_well_formed_and_reproducible(name, tmp_path):
    first, second = (DRAW[name](tmp_path / f"{n}.svg") for n in "ab")
    assert ElementTree.parse(first).getroot().tag.endswith("svg")
    assert first.read_bytes() == second.read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {"a.svg", "b.svg"}


def test_png_is_written(tmp_path):
    path = DRAW["learning"](tmp_path / "new" / "curve.png")
    assert path.read_bytes().startswith(b"\x89PNG")


def test_every_model_has_its_own_colour_in_the_figure(tmp_path):
    text = DRAW["paths"](tmp_path / "a.svg").read_text()
    for name in samples.replay().tracks:
        assert style_of(name).color in text


def test_a_failed_drawing_keeps_the_old_file(tmp_path):
    path = tmp_path / "a.unheard-of"
    path.write_text("before")
    with pytest.raises(ValueError, match="unheard-of"):
        DRAW["paths"](path)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "before"


def test_hostile_names_are_text_in_a_figure(tmp_path):
    path = draw_paths(samples.replay(models=(HOSTILE,)), tmp_path / "a.svg")
    assert "<script" not in path.read_text()
    assert "alert" in "".join(ElementTree.parse(path).getroot().itertext())


@pytest.mark.parametrize("bodies", [1, 3])
def test_any_number_of_disks(bodies, tmp_path):
    push = samples.replay()
    pick = np.arange(bodies) % 2
    tracks = {
        name: Track(track.position[:, pick], track.angle[:, pick], track.pusher)
        for name, track in push.tracks.items()
    }
    push = Replay("p", push.time_step, (0.05,) * bodies, 0.005, tracks)
    assert draw_paths(push, tmp_path / "a.svg").stat().st_size > 1000


def test_unobserved_and_diverged_steps_are_left_out(tmp_path):
    push = samples.replay()
    push.tracks["in"].position[100:] = np.nan
    text = draw_paths(push, tmp_path / "a.svg").read_text()
    assert "nan" not in text.lower()
    curves = {"in": np.full((5, 1), np.nan), "sain": np.ones((5, 1))}
    text = draw_error_over_time(curves, tmp_path / "b.svg", time_step=0.1).read_text()
    assert "SAIN" in text


def test_a_replay_refuses_tracks_that_do_not_fit():
    push = samples.replay()
    with pytest.raises(ValueError, match="2 bodies|1 bodies"):
        dataclasses.replace(push, radius=(0.05,))
    # While the tests run, the annotated shapes may be what refuses.
    with pytest.raises((ValueError, TypeError)):
        Track(np.zeros((3, 2, 2)), np.zeros((3, 2)), np.zeros((2, 2)))


def test_errors_of_a_replay_are_millimetres_and_degrees():
    push = samples.replay()
    assert push.errors_mm("physics")[-1] == pytest.approx([3.8, 0.7 * 3.8])
    assert push.final_turn_deg("physics") == pytest.approx([0.9, 0.54])


DEUTERANOPIA = (
    (0.367322, 0.860646, -0.227968),
    (0.280085, 0.672501, 0.047413),
    (-0.011820, 0.042940, 0.968881),
)
PROTANOPIA = (
    (0.152286, 1.052583, -0.204868),
    (0.114503, 0.786281, 0.099216),
    (-0.003882, -0.048116, 1.051998),
)


def test_labels_keep_their_order_and_distance():
    wanted = np.array([5.0, 0.0, 5.5, 0.2, 20.0])
    places = spread(wanted, 2.0)
    assert np.array_equal(np.argsort(places), np.argsort(wanted))
    assert np.diff(np.sort(places)).min() >= 2.0 - 1e-9
    assert places[4] == 20.0
    assert places[[1, 3]].mean() == pytest.approx(0.1)


def test_unknown_models_get_colours_of_their_own():
    styles = styles_of(["sain", "runs/a", "runs/b", "runs/c", "runs/a"])
    assert len({style.color for style in styles.values()}) == len(styles) == 4
    assert {style.variable for style in styles.values()} <= css_variables(
        dark=True
    ).keys()
    assert len(style_of("runs/" + 60 * "x").label) <= 40


def test_a_model_without_a_colour_of_its_own_keeps_its_label():
    bullet = SIMULATORS["bullet"]
    known = ModelId(kind="sain", simulator=bullet, variant="bystander")
    styles = styles_of([known.slug, "runs/in-bystander"], [known])
    labels = [style.label for style in styles.values()]
    assert labels == ["SAIN around Bullet, bystander", "runs/in-bystander"]


def test_lines_differ_without_their_colours():
    others = ("physics-true", "in", "sain-bullet", "sain-true")
    styles = styles_of([*others, *(f"runs/{number}" for number in range(6))])
    dashes = {style.dash for style in styles.values()}
    assert len(dashes) == len(styles) == 10
    assert () not in dashes  # truth, physics and SAIN


def rgb(color):
    return np.array([int(color[start : start + 2], 16) / 255 for start in (1, 3, 5)])


def linear(color):
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


def seen(color, vision):
    """In CIELAB, as by the matrices of Machado et al. (2009) for dichromats."""
    to_xyz = [
        [0.4339, 0.3762, 0.1899],
        [0.2127, 0.7152, 0.0722],
        [0.0178, 0.1095, 0.8727],
    ]
    x, y, z = np.cbrt(np.clip(to_xyz @ (vision @ linear(rgb(color))), 1e-6, 1))
    return np.array([116 * y, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("vision", [DEUTERANOPIA, PROTANOPIA])
def test_solid_lines_differ_from_others_on_dark_pages_for_the_colour_blind(vision):
    colors = {k: v for k, v in css_variables(dark=True).items() if "--model" in k}
    places = {name: seen(color, np.array(vision)) for name, color in colors.items()}
    for solid in ("truth", "physics", "sain"):
        name = style_of(solid).variable
        others = [place for other, place in places.items() if other != name]
        assert min(np.linalg.norm(place - places[name]) for place in others) > 9


def luminance(color):
    """Of red, green and blue from 0 to 1, as the WCAG has it."""
    return linear(color) @ (0.2126, 0.7152, 0.0722)


def contrast(percent, *names, dark):
    """With the paper, of a mixture of two colours of the palette."""
    colors = css_variables(dark=dark)
    one, other, paper = (rgb(colors[name]) for name in (*names, "--paper"))
    mixed = other + int(percent) / 100 * (one - other)
    low, high = sorted([luminance(mixed), luminance(paper)])
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("dark", [False, True])
def test_faint_text_can_be_read(dark):
    (percent,) = re.findall(r"--faint: color-mix.*?(\d+)%", read("report.css"))
    assert contrast(percent, "--ink", "--paper", dark=dark) >= 4.5  # AA


@pytest.mark.parametrize("dark", [False, True])
def test_the_outline_of_the_live_goal_can_be_seen(dark):
    css = assets(PlayConfig())["/play.css"].body.decode()
    found = re.findall(
        r"#goal .reach.*stroke: color-mix\(.*(--.*)\) (\d+)%, var\((.*)\)\);", css
    )
    ((one, percent, other),) = found
    assert contrast(percent, one, other, dark=dark) >= 3  # AA, of graphics


def test_a_running_mean_averages_neighbouring_losses(tmp_path):
    losses = np.random.default_rng(0).lognormal(size=60)
    assert running_mean(losses)[30] == pytest.approx(losses[27:33].mean())
    assert running_mean(losses[:5]).tolist() == losses[:5].tolist()  # too few


def test_a_computed_label_is_whole_and_a_long_given_name_keeps_its_end():
    simulator = SIMULATORS["bullet"]
    features = "letter-push-frame"
    one = ModelId(kind="sain", simulator=simulator, features=features)
    other = ModelId(kind="published", name="runs/" + "x" * 50 + "/end")
    labels = labels_of([one, other])
    assert labels[one.slug] == one.label
    assert labels[other.slug][0] == "…" and labels[other.slug][-4:] == "/end"


def test_a_legend_names_only_the_curves_that_are_drawn(tmp_path):
    whole = samples.histories()
    nothing = np.array([])
    alone = {name: (*parts[:2], nothing, nothing) for name, parts in whole.items()}
    empty = {"in": (nothing,) * 4}
    for histories, told in ((whole, True), (alone, False), (empty, False)):
        path = draw_learning_curve(histories, tmp_path / "a.svg")
        assert (">validation<" in path.read_text()) is told
