"""Files of predictions that were made elsewhere, as models."""

import io
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import equinox as eqx
import numpy as np
from jaxtyping import Float

from sainet.api.pushes import Dataset, store_of
from sainet.datasets.recorded.problems import Problems
from sainet.datasets.recorded.tables import (
    LARGEST,
    Columns,
    Table,
    read_bytes,
    read_csv,
)
from sainet.models.dynamics import AbstractDynamics, Given, Hashes
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.runs.errors import BadInput
from sainet.scenes.controls import Controls
from sainet.scenes.quantities import ANGLE, MOST_PUSHES, MOST_STEPS, POSITION
from sainet.scenes.scene import Scene
from sainet.scenes.state import State, Trajectory

_POSE = ("x", "y", "angle")
_RANGES = (POSITION, POSITION, ANGLE)
_TIMED = 4  # axes of poses with time
_HEADER = 10_000  # bytes, at most, of the names of columns


class FilePredictions(AbstractDynamics):
    """Poses of stored pushes by the hashes of the pushes."""

    path: Path = eqx.field(static=True)
    hashes: np.ndarray  # [push], sorted
    pose: np.ndarray  # m, m, rad; [push, time, body, 3], or final [push, body, 3]

    def recall(
        self, hashes: Callable[[], Hashes], steps: int, bodies: int
    ) -> np.ndarray:
        """Return the poses of pushes.

        Raises:
            BadInput: some pushes have no prediction, or one of another size.
        """
        wanted = hashes()
        places = np.searchsorted(self.hashes, wanted).clip(max=len(self.hashes) - 1)
        missing = np.flatnonzero(self.hashes[places] != wanted)
        if len(missing):
            raise BadInput(
                f"{self.path}: no prediction of {len(missing)} of the {len(wanted)} "
                f"pushes, of the hash {wanted[missing[0]]:012x} for example."
            )
        found = self.pose[places]
        if found.shape[-2] != bodies:
            raise BadInput(
                f"{self.path}: predicts {found.shape[-2]} bodies, the pushes have "
                f"{bodies}."
            )
        if found.ndim == _TIMED and found.shape[1] < steps:
            raise BadInput(
                f"{self.path}: predicts {found.shape[1]} steps, the pushes have "
                f"{steps}; predict all steps, or the final poses only."
            )
        return found

    def begin(self, scene: Scene, state: State) -> NoReturn:
        """Refuse: a file predicts stored pushes only.

        Raises:
            BadInput: always.
        """
        raise BadInput(
            f"{self.path}: has predictions of stored pushes, and can neither predict "
            "others nor plan; give a function (`from_function`)."
        )

    def advance(
        self, scene: Scene, carry: None, controls: Controls, simulated: Given = None
    ) -> tuple[None, Trajectory]:
        """Refuse, as `begin` does."""
        return self.begin(scene, carry)  # pyright: ignore[reportArgumentType]


@dataclass(frozen=True)
class _Content:
    """Keys and poses as a file has them."""

    keys: np.ndarray | None  # hashes or rows; None: the order of the pushes
    are_hashes: bool
    pose: np.ndarray


def from_predictions(
    path: Path | str, pushes: Dataset | None = None, *, name: str | None = None
) -> Model:
    """Return a model whose predictions of stored pushes are in a file.

    `evaluate` compares it with others. Predictions are of all steps, or only of the
    poses at the end; then only errors at the end are known.

    Args:
        path: a .npz file with `pose` [push, time, body, 3] or [push, body, 3] (m, m,
            rad) and either `hash` [push] (`Pushes.hashes`) or `row` [push], the
            0-based index in `pushes`; without both, in the order of `pushes`. Or a
            .csv file with the columns `hash` (twelve hexadecimal digits) or `row`,
            `body` (from 1), `x`, `y` (m), `angle` (rad), and `step` (from 1) unless the
            poses are final ones. Where a push is shorter than the longest, its last
            pose is repeated.
        pushes: that rows count; not needed for hashes.
        name: of the model in tables; None: the name of the file.

    Raises:
        BadInput: the file is missing, damaged or incomplete, a number is out of range,
            or a row is not one of the pushes.
    """
    path = Path(path)
    data = read_bytes(path, ".npz", ".csv")
    is_csv = path.suffix.lower() == ".csv"
    content = _from_csv(path, data) if is_csv else _from_npz(path, data)
    hashes = _hashes(path, content, pushes)
    order = np.argsort(hashes, kind="stable")
    hashes, pose = hashes[order], content.pose[order]
    differ = (pose[1:] != pose[:-1]).any(axis=tuple(range(1, pose.ndim)))
    if len(alike := np.flatnonzero((hashes[1:] == hashes[:-1]) & differ)):
        rows = " and ".join(map(str, sorted(order[alike[0] :][:2])))
        raise BadInput(
            f"{path}: predictions {rows} differ, but are of one push: start and "
            "command identify it, not masses and frictions. Give a function "
            "(`from_function`)."
        )
    dynamics = FilePredictions(path, hashes, pose)
    return Model(ModelId(kind="physics", name=name or path.stem), dynamics)


def _hashes(path: Path, content: _Content, pushes: Dataset | None) -> Hashes:
    """Return the hash of each push of the file."""
    if content.are_hashes and content.keys is not None:
        return _distinct(path, "hash", content.keys.astype(np.uint64))
    if pushes is None:
        raise BadInput(
            f"{path}: has rows, not hashes; give the `pushes` that they count."
        )
    known, count = store_of(pushes).push_hashes(), len(content.pose)
    rows = np.arange(count) if content.keys is None else content.keys
    if len(rows) and not (rows.min() >= 0 and rows.max() < len(known)):
        bad = rows[(rows < 0) | (rows >= len(known))][0]
        raise BadInput(
            f"{path}: row is {bad}; there are {len(known)} pushes, from 0 on."
        )
    return known[_distinct(path, "row", rows.astype(int))]


def _distinct(path: Path, name: str, keys: np.ndarray) -> np.ndarray:
    found, counts = np.unique(keys, return_counts=True)
    if (counts > 1).any():
        raise BadInput(f"{path}: {name} {found[counts > 1][0]} is there twice.")
    return keys


def _from_npz(path: Path, data: bytes) -> _Content:
    arrays = _arrays(path, data)
    pose = arrays.get("pose")
    if pose is None or pose.ndim not in (_TIMED - 1, _TIMED) or pose.shape[-1] != 3:  # noqa: PLR2004
        shape = "missing" if pose is None else f"of the shape {list(pose.shape)}"
        raise BadInput(
            f"{path}: pose is {shape}; it must be [push, time, body, 3] or "
            "[push, body, 3]."
        )
    if not (pose.size and pose.dtype.kind == "f"):
        raise BadInput(f"{path}: pose is empty, or not of floating-point numbers.")
    for column, quantity in enumerate(_RANGES):
        quantity.check(pose[..., column], f"{path}: pose, {_POSE[column]}")
    keys = arrays.get("hash", arrays.get("row"))
    if keys is not None and (
        keys.shape != pose.shape[:1] or keys.dtype.kind not in "iu"
    ):
        raise BadInput(
            f"{path}: hash or row must be {len(pose)} whole numbers, one for each push."
        )
    return _Content(keys, "hash" in arrays, pose.astype(np.float64))


def _arrays(path: Path, data: bytes) -> Mapping[str, np.ndarray]:
    """Return the known arrays of a .npz file."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(each.file_size for each in archive.infolist())
        if size > LARGEST:
            raise BadInput(f"{path}: is too large: over {LARGEST >> 30} GB unpacked.")
        with np.load(io.BytesIO(data)) as file:
            known = ("pose", "hash", "row")
            return {name: file[name] for name in known if name in file}
    except BadInput:
        raise
    # NumPy's reader raises arbitrary exceptions on damaged files.
    except Exception as error:
        raise BadInput(
            f"{path}: not a .npz file of numbers ({type(error).__name__}); write it "
            "with numpy.savez."
        ) from None


def _from_csv(path: Path, data: bytes) -> _Content:
    lines = data[:_HEADER].decode("utf-8-sig", "replace").splitlines()
    header = [name.strip(' "') for name in "".join(lines[:1]).split(",")]
    are_hashes, has_steps = "hash" in header, "step" in header
    numbers = ("body", *_POSE, *(["step"] if has_steps else []))
    columns = Columns(
        texts=("hash",) if are_hashes else (),
        numbers=numbers if are_hashes else ("row", *numbers),
    )
    problems = Problems()
    table = read_csv(path, data, columns, problems)
    for quantity, column in zip(_RANGES, _POSE, strict=True):
        table.check(problems, quantity, column)
    problems.raise_any()
    pushes, keys = _keys(table, are_hashes=are_hashes)
    body = _count(table, "body") - 1
    step = _count(table, "step") - 1 if has_steps else np.zeros_like(body)
    pose = _placed(table, pushes, step, body)
    return _Content(keys, are_hashes, pose if has_steps else pose[:, 0])


def _keys(table: Table, *, are_hashes: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of the push of each line, and the key of each push."""
    if not are_hashes:
        rows, index = np.unique(
            _count(table, "row", low=0, high=MOST_PUSHES), return_inverse=True
        )
        return index, rows
    column = table.texts["hash"]
    try:
        keys = [int(text, 16) for text in column.names]
        return column.code, np.array(keys, np.uint64)
    except (ValueError, OverflowError):
        raise BadInput(
            f"{table.path}: a hash is not twelve hexadecimal digits; write them as "
            "f'{hash:012x}'."
        ) from None


def _count(
    table: Table, name: str, *, low: int = 1, high: int = MOST_STEPS
) -> np.ndarray:
    values = table.numbers[name]
    bad = np.flatnonzero((values % 1 != 0) | (values < low) | (values > high))
    if len(bad):
        raise BadInput(
            f"{table.where(bad[0])}: {name} is {values[bad[0]]:g}; it must be a whole "
            f"number from {low} to {high}."
        )
    return values.astype(int)


def _placed(
    table: Table, push: np.ndarray, step: np.ndarray, body: np.ndarray
) -> Float[np.ndarray, "push time body 3"]:
    """Return the poses of all lines in one array, each of which is there once."""
    shape = tuple(int(index.max()) + 1 for index in (push, step, body))
    if np.prod(shape, dtype=float) != table.rows:
        raise BadInput(
            f"{table.path}: has {table.rows} rows; {shape[0]} pushes of {shape[1]} "
            f"steps and {shape[2]} bodies have {np.prod(shape, dtype=float):g}."
        )
    place = np.ravel_multi_index((push, step, body), shape)
    _distinct(table.path, "a pose, number", place)
    found: Any = np.empty((table.rows, len(_POSE)))
    found[place] = np.column_stack([table.numbers[name] for name in _POSE])
    return found.reshape(*shape, len(_POSE))
