"""The log of a training run: JSON lines, equal after an interruption."""

import json
from pathlib import Path
from typing import Any

from sainet.runs.documents import is_number, read_file, write_bytes
from sainet.runs.errors import BadCheckpoint

LOG = "log.jsonl"


def read_log(folder: Path) -> list[dict[str, Any]]:
    """Return the lines of a log, without a last line that a crash cut.

    Raises:
        BadCheckpoint: another line is damaged.
    """
    path = folder / LOG
    if not path.is_file():
        return []
    *lines, _ = read_file(path, most=1 << 30, error=BadCheckpoint).split(b"\n")
    return [_parsed(path, number, line) for number, line in enumerate(lines, 1)]


def _parsed(path: Path, number: int, line: bytes) -> dict[str, Any]:
    try:
        found = json.loads(line)
        if all(is_number(found[name]) for name in ("iteration", "loss")):
            return found
    except (ValueError, TypeError, LookupError, RecursionError):
        pass
    raise BadCheckpoint(
        f"{path}: line {number} is damaged; it must have iteration and loss. Delete "
        "that line (the network does not depend on it) and run the same command again."
    )


def loss_note(loss: float | None) -> str:
    """Return a loss for a progress bar: nothing before the first is logged."""
    return "" if loss is None else f"loss {loss:.3g}"


def rewind_log(folder: Path, iteration: int) -> list[dict[str, Any]]:
    """Return the lines up to a checkpoint's iteration; delete the others."""
    kept = [line for line in read_log(folder) if line["iteration"] <= iteration]
    text = "".join(json.dumps(line) + "\n" for line in kept)
    write_bytes(folder / LOG, text.encode())
    return kept


def append_log(folder: Path, line: dict[str, Any]) -> None:
    """Add a line."""
    with (folder / LOG).open("a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")
