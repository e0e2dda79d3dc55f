"""The log of a training: JSON lines, the same after a resume."""

import json
from pathlib import Path
from typing import Any

from sainet.runs import write_bytes

LOG = "log.jsonl"


def read_log(folder: Path) -> list[dict[str, Any]]:
    """Return the lines of a log; a line that was cut by a crash is left out."""
    path = folder / LOG
    lines = path.read_text("utf-8").split("\n")[:-1] if path.is_file() else []
    return [json.loads(line) for line in lines if line]


def rewind_log(folder: Path, iteration: int) -> list[dict[str, Any]]:
    """Forget what was logged after the checkpoint that training goes on from."""
    kept = [line for line in read_log(folder) if line["iteration"] <= iteration]
    text = "".join(json.dumps(line) + "\n" for line in kept)
    write_bytes(folder / LOG, text.encode())
    return kept


def append_log(folder: Path, line: dict[str, Any]) -> None:
    """Add a line."""
    with (folder / LOG).open("a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")
