"""The log of a training run: JSON lines, equal after an interruption."""

from collections.abc import Callable
from pathlib import Path

import msgspec

from sainet.runs.documents import read_file, write_bytes
from sainet.runs.errors import BadCheckpoint
from sainet.runs.progress import Advance

LOG = "log.jsonl"
_LARGEST = 1 << 30  # bytes


class LogLine(msgspec.Struct, frozen=True, omit_defaults=True):
    """Losses after an iteration, means over pushes and without l2."""

    iteration: int
    loss: float  # of the batch
    validation_loss: float | None = None  # None without validation pushes


def read_log(folder: Path) -> tuple[LogLine, ...]:
    """Return the lines of a log, without a last line that a crash cut.

    Raises:
        BadCheckpoint: another line is damaged.
    """
    path = folder / LOG
    if not path.is_file():
        return ()
    *lines, _ = read_file(path, most=_LARGEST, error=BadCheckpoint).split(b"\n")
    return tuple(_parsed(path, number, line) for number, line in enumerate(lines, 1))


def _parsed(path: Path, number: int, line: bytes) -> LogLine:
    try:
        return msgspec.json.decode(line, type=LogLine)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        raise BadCheckpoint(
            f"{path}: line {number} is damaged; it must have iteration and loss. "
            "Delete that line (the network does not depend on it) and run the same "
            "command again."
        ) from None


def loss_note(loss: float | None) -> str:
    """Return a loss for a progress bar: nothing before the first is logged."""
    return "" if loss is None else f"loss {loss:.3g}"


def rewind_log(folder: Path, iteration: int) -> tuple[LogLine, ...]:
    """Return the lines up to a checkpoint's iteration; delete the others."""
    kept = tuple(line for line in read_log(folder) if line.iteration <= iteration)
    write_bytes(folder / LOG, "".join(map(_text, kept)).encode())
    return kept


def append_log(folder: Path, line: LogLine) -> None:
    """Add a line."""
    with (folder / LOG).open("a", encoding="utf-8") as file:
        file.write(_text(line))


def _text(line: LogLine) -> str:
    """Return a line of JSON; a validation loss that is not finite becomes null."""
    return msgspec.json.encode(line).decode() + "\n"


def reported(advance: Advance) -> Callable[[int, float | None], None]:
    """Return the observer of a training run that advances a progress bar."""
    done = 0

    def on_step(iteration: int, loss: float | None) -> None:
        nonlocal done
        advance(iteration - done, loss_note(loss))
        done = iteration

    return on_step
