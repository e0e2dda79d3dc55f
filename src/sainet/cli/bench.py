"""`sainet bench`, and the time of whole commands."""

import shlex
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from tyro.conf import Positional

from sainet.cli.devices import use_devices
from sainet.cli.output import Json, Output
from sainet.runs.errors import SainetError

if TYPE_CHECKING:
    from sainet.bench import Figures

# In this order: later commands read the pushes of earlier ones.
COMMANDS = (
    "sainet --help",
    "sainet generate robot --pushes 4500 --out pushes",
    "sainet generate robot --pushes 4500 --engine bullet "
    "--assumed-engine bullet planar --out bullet",
    "sainet train sain --data pushes --out network",
    "sainet train sain --data pushes --decay cosine --iterations 5000 "
    "--short-iterations 2500 --out shorter",
    "sainet generate robot --disks 1 --pushes 500 --out own",
    "sainet tune gp --data own --out gp",
    "sainet cross-validate --data own --pushes 300 --out validated",
    "sainet demo --out demo",
)
_WHOLE = {"commands": "sainet.cli.bench:bench_commands"}


def bench_commands(runs: int = 3, commands: Sequence[str] = COMMANDS) -> "Figures":
    """Return the time of whole commands, each a new process (s).

    Args:
        runs: number of measurements, for the median; each in a new folder.
        commands: later ones may read the output of earlier ones.

    Raises:
        SainetError: a command failed.
    """
    from sainet.bench.timing import check_runs

    check_runs(runs)
    seconds: dict[str, list[float]] = {command: [] for command in commands}
    for _ in range(runs):
        with TemporaryDirectory() as folder:
            for command in commands:
                seconds[command].append(_seconds(command, Path(folder)))
    return {k: median(found) for k, found in seconds.items()} | {"runs": runs}


def _seconds(command: str, folder: Path) -> float:
    _, *words = shlex.split(command)
    line = [sys.executable, "-m", "sainet", *words]
    start = time.perf_counter()
    if subprocess.call(line, cwd=folder, stdout=subprocess.DEVNULL):
        raise SainetError(f"{command}: it failed; repair what its message above names.")
    return time.perf_counter() - start


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Measure the speed of training, engines and planning on this machine."""

    cases: Positional[tuple[str, ...]] = ()
    """Benchmark cases: training, engines, planning, screening, disks, environments,
    start, and commands, which takes an hour. Default: all but commands."""
    runs: int | None = None
    """Number of measurements of each case. Default: 5; 3 of start and commands, 10
    decisions of screening, 50 of planning."""
    devices: int | None = None
    """Number of CPU devices that share a batch. Default: one per core."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Run the cases one after another.

        Returns:
            The figures of one case; of several, an object of figures for each: some
            have figures of one name.
        """
        use_devices(self.devices)
        from rich.text import Text

        from sainet.bench import CASES
        from sainet.runs.names import load_named

        # Every name is looked up before anything is measured.
        names, known = self.cases or tuple(CASES), {**CASES, **_WHOLE}
        cases = {name: load_named("benchmark", known, name) for name in names}
        figures: dict[str, Figures] = {}
        for name, case in cases.items():
            self.output.say(f"Measuring {name} ...")
            figures[name] = case() if self.runs is None else case(self.runs)
            for key, value in figures[name].items():
                line = Text(f"  {key}: {value}")  # a value may look like markup
                self.output.console.print(line, soft_wrap=True)
        return figures if len(figures) > 1 else next(iter(figures.values()))
