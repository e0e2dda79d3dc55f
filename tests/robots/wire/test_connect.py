"""Connecting to a cell over loopback, in real time, and what is refused before."""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import jax
import numpy as np
import pytest
from msgspec.structs import replace

from robots.wire.disks_beneath import EVERY, disks_beneath
from robots.wire.emulated_tracker import free_port
from robots.wire.real_controller import RealController
from sainet.cli.entry import run
from sainet.control.collect import SUMMARY, collect, push_file, summary_of
from sainet.control.collected import read_push
from sainet.control.config import CollectConfig, ControlConfig
from sainet.control.trials import run_trials
from sainet.robots import RobotConfig, make_robot
from sainet.robots.wire.abb import AbbRobot
from sainet.robots.wire.cell import Cell, read_cell
from sainet.robots.wire.connect import ask_operator, connect
from sainet.robots.wire.limits import CYCLE
from sainet.robots.wire.transport import UdpTransport
from sainet.runs.errors import BadInput, SainetError
from sainet.scenes.pushes import Push, PushGrid
from support import REPOSITORY

EXAMPLE = REPOSITORY / "examples" / "cell.toml"
PUSH: Push = jax.tree.map(lambda x: x[33], PushGrid().pushes())


def example() -> Cell:
    """The example at free ports, patient with a busy machine."""
    made = read_cell(EXAMPLE)
    tracker = replace(
        made.tracker,
        port=free_port(),
        rate_hz=1 / (EVERY * CYCLE),
        largest_age_s=1.0,
        most_faulty_frames=5,
    )
    motion = replace(made.motion, hold_s=0.3, largest_age_cycles=25.0)
    controller = replace(made.controller, port=free_port())
    return replace(made, controller=controller, tracker=tracker, motion=motion)


@contextmanager
def running(cell: Cell, names: list[str] | None = None) -> Iterator[RealController]:
    names = names or [disk.body for disk in cell.disks]
    start = cell.calibration.table_to_robot.moved(np.array([-0.13, 0.05, 0.06]))
    beneath = partial(disks_beneath, cell, names)
    with RealController(start, cell.controller.port, beneath=beneath) as controller:
        yield controller


@pytest.mark.slow
def test_a_push_over_loopback_in_real_time():
    cell = example()
    with running(cell), connect(cell) as robot:
        troubles = []
        for _ in range(5):  # a busy machine is late at times, which stops a push
            before = robot.observe()
            recording = robot.push(PUSH)
            troubles.append(recording.trouble)
            if not recording.trouble:
                break
        after = robot.observe()
    assert not troubles[-1], troubles
    assert recording.commanded == PUSH
    poses = recording.pose[np.isfinite(recording.pose).all(axis=(1, 2))]
    start, end = np.asarray(before.position), np.asarray(after.position)
    np.testing.assert_allclose(poses[0, :, :2], start, atol=2e-4)
    np.testing.assert_allclose(poses[-1, :, :2], end, atol=2e-4)
    assert np.linalg.norm(end - start, axis=1) == pytest.approx(0.0105, abs=2e-3)
    assert len(poses) > 0.4 / (EVERY * CYCLE)


@pytest.mark.slow
def test_a_tracker_with_other_names_is_refused_before_anything_moves():
    cell = example()
    with running(cell, ["disk-1", "disc-2"]) as controller:
        with pytest.raises(BadInput, match="'disk-2'.*Available: disc-2, disk-1"):
            connect(cell)
        assert controller.report().answers == []


def written(tmp_path: Path, cell: Cell) -> Path:
    """The example as a file, with the ports of a cell."""
    text = EXAMPLE.read_text()
    text = text.replace("port = 6510", f"port = {cell.controller.port}")
    path = tmp_path / "cell.toml"
    path.write_text(text.replace("port = 51001", f"port = {cell.tracker.port}"))
    return path


@pytest.mark.parametrize("device", ["tracker", "controller"])
def test_another_process_on_a_port_is_one_line(tmp_path, device):
    cell = example()
    port = getattr(cell, device).port
    other = UdpTransport(controller="127.0.0.1", port=port)
    config = RobotConfig(robot="abb", config=written(tmp_path, cell))
    with pytest.raises(BadInput, match=f"port {port}") as error:
        make_robot(config, 0)
    other.close()
    assert "\n" not in str(error.value) and error.value.exit_status == 2
    for each in (cell.tracker.port, cell.controller.port):  # nothing listens any more
        UdpTransport(controller="127.0.0.1", port=each).close()


def test_the_number_of_disks_is_that_of_the_cell(tmp_path):
    text = EXAMPLE.read_text()
    second = re.search(r"\[\[disks\]\]\nbody = \"disk-2\"\n(.*\n){3}", text)
    assert second
    path = tmp_path / "cell.toml"
    path.write_text(text.replace(second[0], ""))
    with pytest.raises(BadInput, match=r"cell.toml: it has 1 \[\[disks\]\], not 2"):
        make_robot(RobotConfig(robot="abb", config=path), 0)


def test_a_session_knows_its_cell_by_its_disks_and_not_by_its_path(tmp_path):
    def settings(name: str, old: str = "", new: str = "") -> object:
        path = tmp_path / name
        path.write_text(EXAMPLE.read_text().replace(old, new, 1))
        return RobotConfig(robot="abb", config=path).settings()

    known = settings("cell.toml")
    assert known == settings("moved.toml")
    assert known == settings("cell.toml", "hold_s = 1.0", "hold_s = 2.0")
    assert known != settings("cell.toml", "radius_mm = 52.5", "radius_mm = 54.0")


@pytest.mark.parametrize("text", [None, "surface = 1"])
def test_a_cell_that_cannot_be_read_leaves_no_run_folder(tmp_path, text):
    path, out = tmp_path / "cell.toml", tmp_path / "out"
    if text is not None:
        path.write_text(text)
    with pytest.raises(BadInput, match="cell.toml: "):
        collect(CollectConfig(robot="abb", config=path), out)
    with pytest.raises(BadInput, match="cell.toml: "):
        run_trials(ControlConfig(robot="abb", config=path, model="physics"), out)
    assert not out.exists()


def test_the_operator_confirms_on_the_terminal(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    ask_operator("Put the disks there.")
    assert "Put the disks there. Then press Enter." in capsys.readouterr().err
    with pytest.raises(SainetError, match="nobody is at the terminal"):
        ask_operator("Put the disks there.")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["record", "control"])
def test_a_dry_run_shows_every_command_and_sends_none(
    tmp_path, monkeypatch, capsys, command
):
    cell, out = example(), tmp_path / "out"
    monkeypatch.setattr(AbbRobot, "arrange", lambda self, state: None)  # they lie well
    words = [command, "--robot", "abb", "--config", str(written(tmp_path, cell))]
    words += ["--out", str(out), "--dry-run", "--quiet"]
    words += ["--pushes", "1"] if command == "record" else ["--trials", "1"]
    words += [] if command == "record" else ["--model", "physics"]
    with running(cell) as controller:
        assert run(words) == 0
        assert controller.report().answers == []
    shown = [line for line in capsys.readouterr().err.splitlines() if " mm" in line]
    # The push itself: 10 mm at 50 mm/s, one command each 4 ms; and the ways to it.
    assert len(shown) > 100
    assert not out.exists()


def test_an_area_without_room_for_the_disks_of_a_cell_is_refused(tmp_path, capsys):
    cell, out = example(), tmp_path / "out"
    apart = sum(disk.radius_mm for disk in cell.disks)
    words = ["record", "--robot", "abb", "--config", str(written(tmp_path, cell))]
    assert run([*words, "--area-mm", f"{apart - 1:g}", "--out", str(out)]) == 2
    says = f"--area-mm is {apart - 1:.1f}; it must be at least {apart:g}."
    assert says in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.slow
def test_pushes_of_a_cell_are_recorded_in_files(tmp_path, monkeypatch):
    cell, out = example(), tmp_path / "out"
    monkeypatch.setattr(AbbRobot, "arrange", lambda self, state: None)
    settings = {"robot": "abb", "config": written(tmp_path, cell), "gap_mm": 5.0}
    config = CollectConfig(**settings, pushes=1, area_mm=2000.0)
    with running(cell), suppress(BadInput):  # a busy machine may stop the push
        collect(config, out)
    found = read_push(push_file(out, 0))
    assert found.surface == cell.surface
    radius = [each.radius_mm / 1000 for each in cell.disks]
    assert found.radius == pytest.approx(radius)
    if found.trouble:
        assert not (out / SUMMARY).exists()
    else:
        assert found.commanded is not None
        assert summary_of(out).usable == 1
