"""Progress bars where somebody is watching."""

import sys
from contextlib import AbstractContextManager

from sainet.runs.progress import Advance, progress_bar


def shown_progress(
    title: str, total: int | None, wanted: bool | None
) -> AbstractContextManager[Advance]:
    """Return a progress bar; by default, only a terminal shows it."""
    is_shown = sys.stderr.isatty() if wanted is None else wanted
    return progress_bar(title, total, quiet=not is_shown)
