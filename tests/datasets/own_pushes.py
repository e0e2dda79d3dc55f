"""Tables of somebody's own pushes: two disks and an analytic motion."""

import io
from pathlib import Path

import numpy as np

HEADER = ["push", "time", "body", "x", "y", "angle", "pusher_x", "pusher_y"]
PROPERTIES = """
[bodies.far]
mass = 1.0
radius = 0.05
[bodies.near]
mass = 0.5
radius = 0.04
[pusher]
radius = 0.005
[friction]
table = 0.3
contact = 0.2
"""
SPEED = {"far": 0.02, "near": 0.03}  # m/s
START = {"far": 0.3, "near": 0.2}  # m
TURNING = {"far": -0.1, "near": 0.2}  # rad/s


def at(body: str, seconds: np.ndarray) -> np.ndarray:
    """Where a disk is: x, y and angle."""
    y = np.full_like(seconds, 0.1)
    return np.column_stack(
        [START[body] + SPEED[body] * seconds, y, 3.1 + TURNING[body] * seconds]
    )


def pusher_at(seconds: np.ndarray) -> np.ndarray:
    return at("near", seconds)[:, :2] - [0.045, 0.0]


def rows(push: str = "1", rate: float = 250.0, duration: float = 0.4) -> list[list]:
    """The rows of one push, the bodies of one time beside each other."""
    seconds = np.arange(round(duration * rate) + 1) / rate
    pusher = pusher_at(seconds)
    poses = {body: at(body, seconds) for body in ("near", "far")}
    return [
        [push, float(time), body, *map(float, poses[body][k]), *map(float, pusher[k])]
        for k, time in enumerate(seconds)
        for body in ("near", "far")
    ]


def to_csv(table: list[list], header: list[str] | None = None) -> str:
    lines = [HEADER if header is None else header, *table]
    return "".join(",".join(map(str, line)) + "\n" for line in lines)


def write(folder: Path, text: str | bytes, properties: str = PROPERTIES):
    """Write a table and its properties into a folder; return both paths."""
    folder.mkdir(parents=True, exist_ok=True)
    table, bodies = folder / "pushes.csv", folder / "bodies.toml"
    table.write_bytes(text if isinstance(text, bytes) else text.encode())
    bodies.write_text(properties)
    return table, bodies


def to_parquet(table: list[list], header: list[str] | None = None, **kinds) -> bytes:
    """The same table as Parquet; columns of other kinds by name."""
    import pyarrow as pa
    from pyarrow import parquet

    names = HEADER if header is None else header
    columns = {
        name: pa.array([row[k] for row in table], kinds.get(name))
        for k, name in enumerate(names)
    }
    buffer = io.BytesIO()
    parquet.write_table(pa.table(columns), buffer)
    return buffer.getvalue()
