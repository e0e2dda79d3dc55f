"""The configuration of a cell: what is refused, and how."""

import ipaddress
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from sainet.robots.wire.cell import read_cell
from sainet.robots.wire.frames import residuals
from sainet.runs.errors import BadInput
from support import REPOSITORY

EXAMPLE = REPOSITORY / "examples" / "cell.toml"


def test_the_example_can_be_read_and_names_loopback_only():
    cell = read_cell(EXAMPLE)
    hosts = {cell.controller.host, cell.controller.listen}
    hosts |= {cell.tracker.host, cell.tracker.listen}
    assert all(ipaddress.ip_address(host).is_loopback for host in hosts)
    np.testing.assert_allclose(cell.scene.radius, 0.0525)
    np.testing.assert_allclose(cell.scene.mass, 0.837)


def test_the_frames_of_the_example_fit_its_points():
    cell = read_cell(EXAMPLE).calibration
    points = {
        frame: np.array([getattr(p, f"{frame}_mm") for p in cell.points]) / 1000
        for frame in ("table", "robot", "tracker")
    }
    for transform, source, target in (
        (cell.table_to_robot, "table", "robot"),
        (cell.tracker_to_table, "tracker", "table"),
    ):
        assert residuals(transform, points[source], points[target]).max() < 1e-9


# What is replaced in the example, by what, and what the line has to name.
FAULTS = {
    "limit missing": ("z_mm = [103.0, 200.0]\n", "", "workspace.*z_mm"),
    "limit reversed": ("[250.0, 750.0]", "[750.0, 250.0]", "workspace.*x_mm"),
    "limit of one side": ("[250.0, 750.0]", "[250.0]", "workspace.x_mm"),
    "limit NaN": ("[250.0, 750.0]", "[nan, 750.0]", "workspace.x_mm"),
    "speed missing": ("largest_speed_mm_s = 150.0\n", "", "motion.*largest_speed_mm_s"),
    "speed in m/s": ("= 100.0\nhold", "= 0.1\nhold", "motion.travel_speed_mm_s"),
    "travel too fast": ("= 100.0\nhold", "= 160.0\nhold", "travel_speed_mm_s.*exceed"),
    "heights": ("push_height_mm = 6.0", "push_height_mm = 70.0", "push_height_mm"),
    "unit forgotten": ("mass_kg", "mass", "disks.*mass"),
    "grams": ("mass_kg = 0.837", "mass_kg = 837.0", r"disks.0..mass_kg"),
    "unknown tracker": ('"vicon-stream"', '"vcon"', "tracker.kind"),
    "one body twice": ('"disk-2"', '"disk-1"', "body"),
    "every address": ('listen = "127.0.0.1"', 'listen = "0.0.0.0"', "listen"),
    "no address": ('host = "127.0.0.1"', 'host = "robot"', "controller.*host"),
    "IPv6": ('host = "127.0.0.1"', 'host = "::1"', "'::1'; it must be one IPv4"),
    "port": ("port = 6510", "port = 0", "controller.port"),
    "residual": ("[700.0, 0.0, 100.0]", "[703.0, 0.0, 100.0]", r"residual of 2.25 mm"),
    "height of a point": ("[700.0, 0.0, 100.0]", "[700.0, 0.0, 106.0]", "residual of"),
    "line": ("0.0, 250.0, 0.0]", "50.0, 0.0, 0.0]", "calibration"),
    "no TOML": ("[pusher]", "[pusher", "cell.toml: "),
    "unknown section": ("[pusher]", "[pushr]", "pusher|pushr"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_one_line_with_file_field_and_remedy(tmp_path: Path, name: str):
    old, new, named = FAULTS[name]
    text = EXAMPLE.read_text()
    assert old in text
    path = tmp_path / "cell.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(BadInput) as error:
        read_cell(path)
    line = str(error.value)
    assert "\n" not in line and line.startswith(f"{path}: ")
    assert re.search(named, line), line
    assert "xamples/cell.toml" in line
    assert error.value.exit_status == 2


def test_points_on_a_line_are_refused(tmp_path: Path):
    text = EXAMPLE.read_text()
    for frame in ("table", "robot", "tracker"):
        numbers = iter(range(10))
        pattern = rf"{frame}_mm = \[.*\]"
        text = re.sub(
            pattern, lambda _, n=numbers, f=frame: f"{f}_mm = [{next(n)}, 0, 0]", text
        )
    path = tmp_path / "cell.toml"
    path.write_text(text)
    with pytest.raises(BadInput, match="the points lie on a line"):
        read_cell(path)


def test_a_missing_file_is_one_line(tmp_path: Path):
    with pytest.raises(BadInput, match="no such file"):
        read_cell(tmp_path / "cell.toml")


def test_no_field_is_without_its_unit():
    """Lengths, speeds and times of the example end in their unit."""
    units = ("_mm", "_mm_s", "_s", "_deg", "_hz", "_kg")
    plain = {"port", "most_faulty_frames", "largest_age_cycles"}

    def numbers(content: object, name: str = "") -> set[str]:
        if isinstance(content, dict):
            return set().union(*(numbers(v, k) for k, v in content.items()))
        if isinstance(content, list):
            return set().union(*(numbers(v, name) for v in content))
        return {name} if isinstance(content, int | float) else set()

    found = numbers(tomllib.loads(EXAMPLE.read_text())) - plain
    assert found and all(name.endswith(units) for name in found), found
