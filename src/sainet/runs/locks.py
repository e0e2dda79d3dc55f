"""Locks on folders, so that one process at a time writes to each."""

import os
from pathlib import Path
from weakref import WeakValueDictionary, finalize

try:
    import fcntl
except ImportError:  # without POSIX, folders are not locked
    fcntl = None


class FolderLock:
    """Exclusive lock on a folder.

    It is released with its last reference and with the process, even by `kill -9`.
    """

    def __init__(self, descriptor: int) -> None:
        """Take over the lock of a file descriptor."""
        finalize(self, os.close, descriptor)


_held: WeakValueDictionary[str, FolderLock] = WeakValueDictionary()


def lock_folder(folder: Path) -> FolderLock | None:
    """Return the lock of a folder, or None if the system has no locks.

    A lock that this process already holds is returned again, for example after an
    exception whose traceback keeps it.

    Raises:
        BlockingIOError: another process holds the lock.
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
        return None  # the file system has no locks
    lock = _held[place] = FolderLock(descriptor)
    return lock
