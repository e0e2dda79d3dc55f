"""Folders that one process at a time works in."""

import os
from pathlib import Path
from weakref import WeakValueDictionary, finalize

try:
    import fcntl
except ImportError:  # no POSIX: folders are not guarded there
    fcntl = None


class FolderLock:
    """The right to work in a folder; other processes wait for its end to get it.

    It ends with the last reference to it, and with the process, even by `kill -9`.
    """

    def __init__(self, descriptor: int) -> None:
        """Have the lock that a descriptor holds."""
        finalize(self, os.close, descriptor)


_held: WeakValueDictionary[str, FolderLock] = WeakValueDictionary()


def lock_folder(folder: Path) -> FolderLock | None:
    """Return the lock of a folder, or None where there are no locks to be had.

    Who has it in this process already gets the same again: after an exception, say,
    whose traceback keeps it.

    Raises:
        BlockingIOError: another process has it.
    """
    place = os.path.realpath(folder)
    if (known := _held.get(place)) is not None:
        return known
    if fcntl is None:
        return None
    descriptor = os.open(place, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        if isinstance(error, BlockingIOError):
            raise
        return None  # a disk that knows no locks
    lock = _held[place] = FolderLock(descriptor)
    return lock
