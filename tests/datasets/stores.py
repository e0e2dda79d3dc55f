"""Small stores for tests: settings, a script that makes one, and their bytes."""

import os
import subprocess
import sys
from pathlib import Path

from sainet.datasets.config import GenerateConfig
from support import SOURCE

SMALL = {"pushes": 28, "chunk_size": 5, "hold_steps": 12, "stroke_mm": (8.0, 10.0)}

# Keyword arguments of GenerateConfig and the folder follow on the command line.
GENERATE = """
import sys
from pathlib import Path
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.runs.errors import SainetError
try:
    generate(GenerateConfig(**eval(sys.argv[1])), Path(sys.argv[2]))
except SainetError as error:
    sys.exit(f"{type(error).__name__}: {error}")
"""


def small(**settings) -> GenerateConfig:
    return GenerateConfig(**(SMALL | settings))


def start_generating(out: Path, **settings) -> subprocess.Popen:
    """Generates a small store in a process of its own, which tests may kill."""
    command = [sys.executable, "-c", GENERATE, repr(SMALL | settings), str(out)]
    environment = os.environ | {"PYTHONPATH": str(SOURCE.parent)}
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a folder, hidden ones too, by its relative path."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def assert_same_files(found: Path, wanted: Path):
    one, other = contents(found), contents(wanted)
    assert one.keys() == other.keys()
    assert [name for name in one if one[name] != other[name]] == []
