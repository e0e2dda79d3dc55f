"""Run the commands whose figures stand in docs/results.md, and write them there.

    python tools/results.py [--recorded FOLDER] [--skip SECTION ...]

Each section is a command, its figures and the machine; none is typed by hand. Finished
runs are not made again, so that a second call measures the benchmarks alone.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from sainet.runs import manifest
from sainet.viz.tables import to_markdown

ROOT = Path(__file__).resolve().parent.parent
SAINET = str(Path(sys.executable).with_name("sainet"))
RUNS = Path("runs/results")
SECTIONS = ("robot", "recorded", "bench", "speed")


def main() -> None:
    """Measure everything and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recorded", type=Path, default=_recorded_folder())
    parser.add_argument("--skip", nargs="*", default=[], choices=SECTIONS)
    options = parser.parse_args()
    parts = [_head()]
    if "robot" not in options.skip:
        parts.append(_robot())
    if "recorded" not in options.skip:
        parts.append(_recorded(options.recorded))
    if "bench" not in options.skip:
        parts.append(_bench())
    if "speed" not in options.skip:
        parts.append(_speed())
    (ROOT / "docs" / "results.md").write_text("\n".join(parts), "utf-8")


def _recorded_folder() -> Path:
    return Path(os.environ.get("SAINET_DATA", ROOT / "../shared/data")) / "mitpush"


def _run(*words: str) -> dict[str, Any]:
    command = [SAINET, *words, "--json", "--quiet"]
    done = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout.splitlines()[-1])


def _seconds(*command: str) -> float:
    start = time.perf_counter()
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    return time.perf_counter() - start


def _head() -> str:
    made = manifest()
    versions = ", ".join(f"{k} {v}" for k, v in made["versions"].items() if v)
    return (
        "# Results\n\nWritten by `python tools/results.py`; every figure is of the "
        "command above it.\n\n"
        f"Machine: {made['processor']}, {made['cores']} cores (shared and noisy: trust "
        f"ratios more than times). Python {made['python']}; {versions}.\n"
    )


def _robot() -> str:
    words = ("reproduce", "robot-planar", "--scale", "paper", "--out", str(RUNS))
    return (
        "## Robot setup, planar truth with noise, planar assumed engine\n\n"
        f"`sainet {' '.join(words)}`: 4,500 pushes, 10,000 iterations, 500 test "
        "pushes, one training of each network. Published rows are the paper's Table "
        "III, whose truth is Bullet with the paper's noise.\n\n"
        f"{to_markdown(_run(*words))}"
    )


def _recorded(folder: Path) -> str:
    data = RUNS / "recorded"
    file = folder / "ellip1_endpoints.csv"
    _run("import", "mitpush-endpoints", str(file), "--out", str(data))
    words = ("evaluate", "--model", "physics", "--data", str(data))
    table = to_markdown(_run(*words))
    return (
        "## Recorded pushes (real), planar engine\n\n"
        "`sainet import mitpush-endpoints ellip1_endpoints.csv --out "
        f"{data}`, then `sainet {' '.join(words)}`.\n\n{table}\n"
        "The contact friction of 0.25 is `mu` in a published log of the same robot and "
        "what an earlier sweep on these same pushes chose: it is no blind guess.\n"
    )


def _bench() -> str:
    lines = []
    for case in ("training", "engines"):
        figures = _run("bench", case)
        lines.append(f"`sainet bench {case} --json`\n")
        lines.append("| figure | value |\n| :-- | --: |")
        lines += [f"| `{k}` | {_short(v)} |" for k, v in figures.items()]
        lines.append("")
    return "## Benchmarks\n\n" + "\n".join(lines)


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _speed() -> str:
    rows = [("`sainet --help`", *_several(5, SAINET, "--help"))]
    out = ROOT / RUNS / "timing"
    for words in (("generate", "robot", "--pushes", "4500"), ("demo",)):
        times = []
        for _ in range(3 if words[0] == "generate" else 1):
            shutil.rmtree(out, ignore_errors=True)
            times.append(_seconds(SAINET, *words, "--out", str(out), "--quiet"))
        rows.append((f"`sainet {' '.join(words)}`", *_median(times)))
    shutil.rmtree(out, ignore_errors=True)
    lines = [f"| {name} | {value:.2f} | {runs} |" for name, value, runs in rows]
    head = "| command | seconds (median) | runs |\n| :-- | --: | --: |"
    return "## Whole commands\n\n" + "\n".join([head, *lines]) + "\n"


def _several(runs: int, *command: str) -> tuple[float, int]:
    return _median([_seconds(*command) for _ in range(runs)])


def _median(times: list[float]) -> tuple[float, int]:
    return sorted(times)[len(times) // 2], len(times)


if __name__ == "__main__":
    main()
