"""Settings that no scene can have are refused, by their names."""

import os
import subprocess
import sys

import pytest

from sainet.cli.entry import run
from sainet.datasets.config import GenerateConfig
from sainet.runs.errors import BadInput, BadSetting
from sainet.scenes.quantities import require_count
from sainet.worlds.config import bounds
from sainet.worlds.noise import NoiseConfig
from support import SOURCE

NAN, INFINITE = float("nan"), float("inf")

BAD = [
    ("engine", "plannar"),
    ("assumed_engine", ("",)),
    ("assumed_engine", ()),
    ("assumed_engine", ("planar", "planar")),
    ("assumed_engine", ("planar", "mujoco")),
    ("disks", 0),
    ("pushes", 0),
    ("pushes", -3),
    ("chunk_size", 0),
    ("force_steps", 0),
    ("hold_steps", -1),
    ("seed", -1),
    ("mass_kg", (0.0, 1.0)),
    ("mass_kg", (-1.0,)),
    ("mass_kg", (NAN, 1.0)),
    ("mass_kg", (2.0, 1.0)),
    ("radius_mm", (0.0,)),
    ("radius_mm", (50.0, NAN)),
    ("radius_mm", (50.0, INFINITE)),
    ("stroke_mm", (0.0,)),
    ("speed_mm_s", (-50.0,)),
    ("table_friction", (-0.1, 0.2)),
    ("table_friction", (NAN,)),
    ("contact_friction", (0.3, 0.2)),
    ("pusher_radius_mm", 0.0),
    ("pusher_radius_mm", NAN),
    ("pusher_radius_mm", INFINITE),
    ("force_n", NAN),
    ("force_n", -8.0),
    ("contact_angle_deg", 90.0),
    ("contact_angle_deg", NAN),
    ("direction_deg", -1.0),
    ("placement_deg", 120.0),
    ("gap_mm", -6.0),
    ("gap_mm", NAN),
    ("gap_mm", INFINITE),
    ("disks", 1_000_000),
    ("pushes", 10**9),
    ("seed", 10**400),
    ("seed", 2**32),  # of two words: its chunks would be those of another seed
    ("force_steps", 10**9),
    ("mass_kg", (1e-46,)),  # zero in single precision
    ("radius_mm", (1e300,)),  # infinite in single precision
    ("table_friction", (1e30,)),
    ("stroke_mm", (1e-6,)),
    ("force_n", 1e300),
]


@pytest.mark.parametrize("value", [None, "3", 3.0, [3], 0])
def test_what_is_no_count_is_refused_by_name(value):
    with pytest.raises(BadSetting, match="^`pushes` is .*; it must be (a whole|at)"):
        require_count("pushes", value)


@pytest.mark.parametrize(("name", "value"), BAD)
def test_bad_settings_are_refused_by_name(name, value):
    with pytest.raises(BadSetting, match=f"^`{name}` is .*; it must be ") as refused:
        GenerateConfig(**{name: value})
    assert "\n" not in str(refused.value)
    assert refused.value.exit_status == 2


def test_values_of_another_type_are_refused_too():
    """In a process of its own: here the checked annotations come first."""
    script = """
from sainet.datasets.config import GenerateConfig
from sainet.runs.errors import BadInput, BadSetting
bad = [("setup", "pull"), ("noise_level", "loud"), ("mass_kg", ()),
       ("mass_kg", (1.0, 2.0, 3.0)), ("mass_kg", 0.9), ("mass_kg", "0.9"),
       ("mass_kg", ((1.0,), (1.0, 2.0))), ("stroke_mm", 10), ("gap_mm", "1"),
       ("gap_mm", None), ("contact_angle_deg", "60"), ("assumed_engine", "planar"),
       ("assumed_engine", None)]
for name, value in bad:
    try:
        GenerateConfig(**{name: value})
    except BadInput as error:
        assert str(error).startswith(f"`{name}` is "), error
    else:
        raise SystemExit(f"{name}={value} was taken")
"""
    environment = os.environ | {"PYTHONPATH": str(SOURCE.parent)}
    command = [sys.executable, "-c", script]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("value", [-1.0, NAN, INFINITE])
@pytest.mark.parametrize("name", NoiseConfig.__dataclass_fields__)
def test_bad_noise_is_refused_by_name(name, value):
    with pytest.raises(BadSetting, match=f"^`{name}` is "):
        GenerateConfig(noise=NoiseConfig(**{name: value}))


@pytest.mark.parametrize("name", NoiseConfig.__dataclass_fields__)
def test_the_command_line_names_the_option(name, tmp_path, capfd):
    option = "--" + name.replace("_", "-")
    assert run(["generate", f"{option}=-1", "--out", str(tmp_path / "out")]) == 2
    assert capfd.readouterr().err.startswith(f"sainet: {option} is -1; it must be ")


@pytest.mark.parametrize("name", ["correlation_time", "friction_length_mm"])
def test_noise_cannot_be_correlated_over_nothing(name):
    with pytest.raises(BadInput, match="is 0; it must be from"):
        GenerateConfig(noise=NoiseConfig(**{name: 0.0}))


def test_settings_at_the_edge_are_taken():
    config = GenerateConfig(
        pushes=1, hold_steps=0, contact_angle_deg=0, table_friction=(0.0,), gap_mm=0.0
    )
    assert bounds(config.table_friction) == (0.0, 0.0)
    assert bounds(config.mass_kg) == (0.85, 1.15)
