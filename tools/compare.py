"""Compare what two trees make: datasets, and the JSON of commands.

    python tools/compare.py BASE [--tolerance 1e-6] [--recorded ENDPOINTS.csv]

BASE is a checkout or a git revision; the other tree is this one. Both run here, with
this Python and its packages. Prints one line for each comparison, with the first
difference if there is one, and exits with 1 if anything differs.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import zarr

ROOT = Path(__file__).resolve().parent.parent
# Keys of JSON that are not compared: times, and what BASE lacks.
EXEMPT = {"median_decision_s"}
_STORE = "--pushes 60 --chunk-size 30 --seed 7 --out"
# Each command ends with its output folder; the later ones read earlier outputs.
COMMANDS = (
    f"generate robot --disks 1 {_STORE} robot-1",
    "generate robot --engine bullet --assumed-engine planar bullet planar-true "
    f"{_STORE} robot-2",
    f"generate robot --disks 5 --noise-level paper-like {_STORE} robot-5",
    f"generate direct-force --noise-level none {_STORE} force-2",
    f"generate direct-force --disks 3 --engine bullet {_STORE} force-3",
    "import mitpush-endpoints RECORDED --out recorded",
    "evaluate --model physics physics-true in sain sain-bullet --data robot-2",
    "evaluate --model physics in-stroke sain-stroke --data recorded",
    "identify --data robot-1 --out identified",
    "control --model sain --planner greedy --trials 2 --out greedy",
    "control --model physics --planner tree --pushes 4 --trials 1 --out tree",
)


def main() -> int:
    """Compare the trees; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("base", help="a checkout, or a git revision")
    parser.add_argument("--tolerance", type=float, default=0.0, help="relative")
    absolute = lambda text: Path(text).resolve()  # noqa: E731
    parser.add_argument("--recorded", type=absolute, help="recorded pushes to import")
    chosen = parser.parse_args()
    differ = False
    with tempfile.TemporaryDirectory() as work:
        base = _tree(chosen.base, Path(work, "tree"))
        places = (base, Path(work, "base")), (ROOT, Path(work, "new"))
        for command in COMMANDS:
            if chosen.recorded or "recorded" not in command:
                words = command.replace("RECORDED", str(chosen.recorded)).split()
                made = (_run(*place, words) for place in places)
                differ |= _print(command, _first(*made, tolerance=chosen.tolerance))
    return int(differ)


def _print(name: str, difference: str) -> bool:
    print(f"{name}: {difference or 'equal'}", flush=True)
    return bool(difference)


def _tree(base: str, exported: Path) -> Path:
    """Return the folder of a checkout, or of a revision that is exported for this."""
    if Path(base).is_dir():
        return Path(base).resolve()
    exported.mkdir()
    archive = ("git", "-C", ROOT, "archive", base)
    packed = subprocess.run(archive, check=True, stdout=subprocess.PIPE).stdout
    subprocess.run(("tar", "-x", "-C", exported), check=True, input=packed)
    return exported


def _run(tree: Path, place: Path, words: list[str]) -> dict[str, Any]:
    """Return the values in a command's JSON and the hashes of the dataset it makes."""
    place.mkdir(exist_ok=True)
    environment = os.environ | {"PYTHONPATH": str(tree / "src")}
    line = (sys.executable, "-m", "sainet", *words, "--json", "--quiet")
    done = subprocess.run(
        line, check=False, cwd=place, env=environment, capture_output=True
    )
    if done.returncode:
        return {str(tree): done.stderr.decode().strip()}
    made = dict(_values(json.loads(done.stdout.splitlines()[-1])))
    return made | _arrays(place / words[-1])


def _arrays(folder: Path) -> dict[str, str]:
    """Return the hash of each array of a dataset; the sign of a zero does not count."""
    return {
        name: sha256((np.asarray(array) + 0).tobytes()).hexdigest()
        for store in folder.glob("*.zarr")
        for name, array in zarr.open_group(store, mode="r").arrays()
    }


def _values(value: object, name: str = "") -> Iterator[tuple[str, object]]:
    """Yield every plain value of JSON with its path."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, each in items:
            if key not in EXEMPT:
                yield from _values(each, f"{name}.{key}")
    else:
        yield name, value


def _first(one: dict[str, Any], other: dict[str, Any], *, tolerance: float) -> str:
    """Return the first difference in words; empty if there is none."""
    for name in one | other:
        was, now = (each.get(name, "missing") for each in (one, other))
        near = isinstance(was, float) and isinstance(now, float)
        if not (math.isclose(was, now, rel_tol=tolerance) if near else was == now):
            return f"{name} was {was} and is {now}"
    return ""


if __name__ == "__main__":
    sys.exit(main())
