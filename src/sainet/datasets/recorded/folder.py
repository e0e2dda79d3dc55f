"""A folder of recorded pushes: there when it is whole, and not before."""

import glob
import logging
import os
import shutil
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from sainet.datasets.store import Store, open_store
from sainet.datasets.writer import HASHES
from sainet.runs.documents import readable, write_error
from sainet.runs.errors import BadInput
from sainet.runs.folders import CONFIG, open_run
from sainet.runs.locks import lock_folder

_log = logging.getLogger(__name__)


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
