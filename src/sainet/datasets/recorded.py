"""What importers of recorded pushes share: frictions, s-bar, a folder made whole."""

import glob
import logging
import os
import shutil
import uuid
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from sainet.datasets.batch import (
    check_finite,
    from_trajectory,
    to_controls,
    to_initial,
    to_scene,
)
from sainet.datasets.schema import StoreInfo
from sainet.datasets.store import Store, open_store
from sainet.datasets.writer import HASHES
from sainet.engines import make_assumed_engine
from sainet.engines.base import roll_out
from sainet.errors import BadInput
from sainet.locks import lock_folder
from sainet.runs import CONFIG, open_run, readable, write_error

_log = logging.getLogger(__name__)

CONTACT_FRICTION = 0.25
TABLE_FRICTION = 0.15  # the paper's; a quasi-static path hardly depends on it


def check_frictions(contact_friction: float, table_friction: float) -> None:
    """Check what the user says of friction.

    Raises:
        BadInput: one is negative or no number.
    """
    # No command has an option for the second: whoever calls from Python set it.
    options = {"--contact-friction": contact_friction, "table_friction": table_friction}
    for name, value in options.items():
        if not 0 <= value < float("inf"):
            raise BadInput(f"{name} is {value}; it must be zero or positive.")


def make_once(
    out: Path, config: dict[str, Any], write: Callable[[Path], None]
) -> Store:
    """Make a store of recorded pushes, unless it is there already.

    Args:
        out: the run folder; it appears when the store is whole and not before.
        config: what decides the store, as JSON values.
        write: fills the folder that it is given with the store.

    Raises:
        RunConflict: the folder holds something else; nothing was touched.
        BadInput: the disk is full.
    """
    if not _is_finished(out, config):
        with _whole_or_nothing(out) as folder:
            run = open_run(folder, config, finished_by=HASHES)
            write(run.path)
    return open_store(out)


def simulate(
    name: str, arrays: dict[str, np.ndarray], info: StoreInfo, pushes: Sequence[str]
) -> Float[np.ndarray, "push time body 6"]:
    """Return s-bar: what an engine predicts with the properties that it assumes.

    Args:
        name: of the assumed engine.
        arrays: scenes, starts and controls of some pushes, by variable name.
        info: of their store.
        pushes: what their file calls each of them.

    Raises:
        Diverged: the engine left the numbers.
    """
    scene, initial = to_scene(arrays, info), to_initial(arrays)
    engine = make_assumed_engine(name)
    trajectory = roll_out(engine, scene, initial, to_controls(arrays, info))
    motion, _ = from_trajectory(trajectory)
    check_finite(name, motion, pushes)
    return motion


def numbered(plans: Sequence[Hashable]) -> Int[np.ndarray, " push"]:
    """Return a number for each push: equal plans share it, the first one's is 0."""
    known = {plan: number for number, plan in enumerate(dict.fromkeys(plans))}
    return np.array([known[plan] for plan in plans], np.int32)


def _is_finished(out: Path, config: dict[str, Any]) -> bool:
    """Whether the folder holds this very store; a folder of other things is refused."""
    with readable(out):
        if not out.exists() or (out.is_dir() and not any(out.iterdir())):
            return False
    finished = open_run(out, config, finished_by=HASHES).is_finished
    if finished:
        _log.info("%s is finished already", out)
    return finished


def partial_folders(out: Path) -> list[Path]:
    """Return the folders in which imports to `out` work, or were killed."""
    place = out.resolve()
    named = f".{glob.escape(place.name)}.*.partial"
    return [path for path in place.parent.glob(named) if path.is_dir()]


def _remove_abandoned(out: Path) -> None:
    for folder in partial_folders(out):
        with suppress(BlockingIOError):  # another import is alive
            if lock_folder(folder) is not None:
                shutil.rmtree(folder)


@contextmanager
def _whole_or_nothing(out: Path) -> Iterator[Path]:
    """Give a folder beside `out` that takes its place if all went well."""
    place = out.resolve()
    folder = place.with_name(f".{place.name}.{uuid.uuid4().hex}.partial")
    try:
        _remove_abandoned(out)
        yield folder
        # Only of a damaged store of the same settings: all of it was made again.
        if (place / CONFIG).is_file():
            shutil.rmtree(place)
        os.replace(folder, place)
    except OSError as error:
        raise write_error(out, error) from error
    except BadInput as error:
        # The user knows nothing of the folder beside.
        raise BadInput(str(error).replace(str(folder), str(out))) from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)
