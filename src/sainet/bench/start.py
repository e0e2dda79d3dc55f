"""How soon a user sees something: the first prediction of a script, and the live page.

Each is measured in new processes, with an empty cache of compiled programs and with the
cache that the first process has left.
"""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from sainet.bench import Figures
from sainet.bench.timing import check_runs, with_cache
from sainet.runs.errors import BadInput

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

SCRIPT = """
import sainet as sn
scene = sn.Scene.disks(mass=[0.9, 1.0], radius=[0.054, 0.059])
push = sn.Push(contact_angle=0.2)
print(sn.load("sain").predict(scene, scene.in_a_row(), push).final.position)
"""
PLAY = ("-m", "sainet", "play")
POINTERS = 200  # predictions of the page in a measurement
_PATIENCE = 120.0  # s
_GOLDEN = 0.618034  # multiples of it cover the interval from 0 to 1 evenly
_MISSING = "needs websockets: pip install 'sainet[live]'"


def bench_start(runs: int = 3, *, pointers: int = POINTERS) -> Figures:
    """Return how long a user waits for the first prediction.

    Args:
        runs: number of measurements, for the median; each in a new folder.
        pointers: number of positions of the pointer over the page.

    Returns:
        `script_cold_s` and `script_warm_s`, from the start of a script to the first
        prediction of a shipped network; `play_cold_s` and `play_warm_s`, from the
        command to the first prediction of the page; `pointer_ms`, from a position of
        the pointer to the predictions of all models (None without websockets, with the
        `reason`).
    """
    check_runs(runs)
    has_page = find_spec("websockets") is not None
    found: dict[str, list[float]] = {}
    for _ in range(runs):
        with TemporaryDirectory() as name:
            folder = Path(name)
            each = _script(folder) | (_page(folder, pointers) if has_page else {})
        for key, value in each.items():
            found.setdefault(key, []).append(value)
    unknown = dict.fromkeys(("play_cold_s", "play_warm_s", "pointer_ms"))
    medians = {key: median(values) for key, values in found.items()}
    reason = None if has_page else _MISSING
    return unknown | medians | {"pointers": pointers, "runs": runs, "reason": reason}


def _script(folder: Path) -> dict[str, float]:
    """Return the seconds of a script, without and with a cache."""
    found = {}
    for cache in ("cold", "warm"):
        start = time.perf_counter()
        line = [sys.executable, "-c", SCRIPT]
        cached = with_cache(folder / "script")
        subprocess.run(line, check=True, env=cached, stdout=subprocess.DEVNULL)
        found[f"script_{cache}_s"] = time.perf_counter() - start
    return found


def _page(folder: Path, pointers: int) -> dict[str, float]:
    """Return the seconds until the page predicts, and the milliseconds afterwards."""
    found = {}
    for cache in ("cold", "warm"):
        start = time.perf_counter()
        with _served(folder) as page:
            page.wait(lambda: page.can("can_predict"))
            page.aim(0)
            found[f"play_{cache}_s"] = time.perf_counter() - start
            if cache == "warm":
                page.wait(lambda: page.can("is_ready"))
                times = [page.aim(number) for number in range(1, pointers + 1)]
                found["pointer_ms"] = 1000 * median(times)
    return found


@contextmanager
def _served(folder: Path) -> Iterator["_Page"]:
    """Run `sainet play`, and yield its page.

    Raises:
        BadInput: the command ended without a page.
    """
    from websockets import Origin  # an optional package
    from websockets.sync.client import connect

    with subprocess.Popen(
        [sys.executable, *PLAY],
        cwd=folder,
        env=with_cache(folder / "page"),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    ) as server:
        try:
            assert server.stdout is not None
            line = next((each for each in server.stdout if "http" in each), None)
            if line is None:
                raise BadInput("sainet play: it ended at once; is its port in use?")
            host = line.split("http://")[1].split()[0].rstrip("/")
            own = Origin(f"http://{host}")
            with connect(f"ws://{host}/live", origin=own, proxy=None) as socket:
                yield _Page(socket)
        finally:
            server.terminate()


@dataclass
class _Page:
    """A client of the page, and the newest message of each type that it received."""

    socket: "ClientConnection"
    newest: dict[str, Mapping[str, object]] = field(default_factory=dict)

    def can(self, what: str) -> bool:
        """Return whether the newest status says that the page can do something."""
        return bool(self.newest.get("status", {}).get(what))

    def wait(self, is_done: Callable[[], bool]) -> None:
        """Receive messages until something is so; earlier messages count."""
        while not is_done():
            message = json.loads(self.socket.recv(timeout=_PATIENCE))
            self.newest[message["type"]] = message

    def aim(self, number: int) -> float:
        """Point at a push, and return the seconds until its predictions arrive."""
        angle = 40 * (number * _GOLDEN % 1) - 20
        aim = {"type": "aim", "contact_angle_deg": angle, "direction_deg": angle / 2}
        start = time.perf_counter()
        self.socket.send(json.dumps(aim | {"number": number}))
        self.wait(lambda: self.newest.get("ghosts", {}).get("number") == number)
        return time.perf_counter() - start
