"""Every documented command runs, with small numbers, and so do programs beside them.

The site runs four pages as they are (docs/site_pages/contents.py). Here the commands of
all pages run in order: sizes are smaller, pieces stay in this process, and studies,
benchmark cases, servers and robots, which have tests of their own, do not start.
"""

import csv
import shlex
import sys
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from unittest.mock import Mock, create_autospec

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from msgspec import structs

import sainet as sn
from datasets import raw_pushes
from documents import (
    PAGES,
    commands,
    indented_program,
    site_contents,
    without_indented,
)
from sainet.api import benchmark
from sainet.cli import entry
from sainet.evaluation.summary import Summary
from sainet.runs import names
from sainet.runs.executors import Machines
from sainet.studies.shares import Shared
from sainet.studies.study import Result
from support import REPOSITORY, require

TEXTS = {page.stem: page.read_text("utf-8") for page in PAGES}
TRACKS = benchmark.tracks()
TEXTS["benchmark"] += "".join(f"\n    {track.command}" for track in TRACKS.values())
PROGRAMS = {page: indented_program(text) for page, text in TEXTS.items()}
# Options that replace those of a page, or are added. Nothing else of a command changes.
FEW_PUSHES = {"--pushes": 4, "--chunk-size": 2, "--stroke-mm": 2, "--hold-steps": 1}
FEW_ITERATIONS = {"--iterations": 2, "--batch-size": 2, "--steps": 2}
SMALL = {
    "generate": FEW_PUSHES,
    "train": FEW_ITERATIONS,
    "tune": FEW_ITERATIONS,
    "tune gp": {"--iterations": 2},
    "control": {"--trials": 1, "--pushes": 1},
    "propose": {"--count": 2},
    "reproduce": {"--at-once": 1},
}
FEWER = {"--short-iterations": 1, "--shard": "1/2"}  # if a page gives another value
# Pages that use what the commands of another page made; and programs that do.
AFTER = {"training": "quick-start", "tutorial-control": "quick-start"}
PROGRAMS_AFTER = {"data-format": "importing", "tutorial-data": "importing"}
BODY = "[bodies.{}]\nmass = 0.9\nradius = 0.05\n"
ENDPOINTS = """\
surface,shape,s,t,vel_mm_s,obj_x0,obj_y0,obj_th0,obj_x1,obj_y1,obj_th1,\
tip_x0,tip_y0,tip_x1,tip_y1,zhou_poly4_x1,zhou_poly4_y1,zhou_poly4_th1
"""
ENDPOINT = "{0},ellip1,0,{1},200,.3,0,0,.33,0,.1,{2},{1},.283,{1},.33,0,.1\n"


def is_run_by_the_site(page: str) -> bool:
    """Whether `make docs` runs every command of a page, or there is none."""
    _, executed = site_contents()
    text = without_indented(TEXTS[page]) if page in executed else ""
    return set(commands(TEXTS[page])) == set(commands(text))


def small(command: str) -> list[str]:
    """The words of a command with the numbers of `SMALL`, without `sainet`."""
    words = shlex.split(command)[1:]
    changes = SMALL.get(" ".join(words[:2]), SMALL.get(words[0], {}))
    given = {option: value for option, value in FEWER.items() if option in words}
    if "--shard" in given and "$" not in words[words.index("--shard") + 1]:
        del given["--shard"]
    for option, value in {**changes, **given}.items():
        if option in words:
            words[words.index(option) + 1] = str(value)
        else:
            words += [option, str(value)]
    return words


def run(command: str) -> None:
    words = small(command)
    status = entry.run(words)
    assert status == 0, f"'{command}' failed as 'sainet {shlex.join(words)}'"


def run_all(page: str) -> None:
    """Run the commands of a page."""
    for command in commands(TEXTS[page]):
        words = shlex.split(command)
        if "abb" not in words:
            run(command)
        elif "record" in words:  # a physical robot: pushes of another origin
            out = words[words.index("--out") + 1]
            run(f"sainet generate --out {out}/dataset")


def write_recordings(folder: Path) -> None:
    """Write files to import: pushes of two disks, and of the MIT Push dataset."""
    rng = np.random.default_rng(0)
    rows = [["push", "time", "body", "x", "y", "angle", "pusher_x", "pusher_y"]]
    for push, angle in enumerate(rng.uniform(-0.8, 0.8, 64)):
        away = 0.055 * np.array([-np.cos(angle), np.sin(angle)])
        for time, done in ((0.0, 0.0), (0.15, 1.0)):
            red = done * np.array([0.006, 0.002 * angle, 0.05 * angle])
            blue = [0.101 + 0.005 * done, 0.0, 0.0]
            for body, pose in (("red", red), ("blue", blue)):
                rows.append([push, time, body, *pose, *away + [0.01 * done, 0]])
    with (folder / "pushes.csv").open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    bodies = BODY.format("red") + BODY.format("blue") + "[pusher]\nradius = 0.005\n"
    (folder / "bodies.toml").write_text(bodies)
    recording = raw_pushes.to_json(raw_pushes.recording())
    files = {raw_pushes.name(s=side): recording for side in (0.25, 0.5)}
    raw_pushes.pack(folder / "ellip1_json.zip", files)
    text = ENDPOINTS
    for surface, side in product(("abs", "plywood"), np.linspace(-0.02, 0.02, 10)):
        text += ENDPOINT.format(surface, side, 0.3 - (0.0573**2 - side**2) ** 0.5)
    (folder / "ellip1_endpoints.csv").write_text(text)


@contextmanager
def in_this_process(self, workers=None, *, core_each=False):
    yield None


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """A folder with recorded pushes, where commands start no process."""
    for package in ("gymnasium", "mujoco", "pybullet", "websockets"):
        require(find_spec(package), f"{package} is not installed")
    write_recordings(tmp_path)
    (tmp_path / "examples").symlink_to(REPOSITORY / "examples")
    monkeypatch.chdir(tmp_path)
    for name, module in list(sys.modules.items()):
        if name.startswith("sainet.cli.") and hasattr(module, "use_devices"):
            monkeypatch.setattr(module, "use_devices", lambda *count: None)
    monkeypatch.setattr(Machines, "executor", in_this_process)
    return tmp_path


@pytest.fixture
def without_what_takes_long(monkeypatch):
    """Gradients, searches, episodes, studies, benchmark cases and the server are empty.

    What they do has tests of its own. All that leads to them and follows runs.
    """
    known = names.load_named

    def found(*words):
        known(*words)
        return lambda *runs: {"runs": 0}

    nothing = Result(summary=Summary(models=()))
    empty = {
        "control.trials.run_episode": lambda *a, **k: None,
        "identification.identify._Problem.solved": lambda self, free: self.start,
        "identification.identify.intervals": lambda values, free, *a: {
            name: (values[name], values[name]) for name in free
        },
        "learning.fit.make_step": lambda *a: next_iteration,
        "learning.process_fit._most_probable": lambda inputs, *a: (
            np.zeros(2 + inputs.shape[1]),
            0.0,
        ),
        "report.live.server.serve": lambda config, on_listening: on_listening("there"),
        "runs.names.load_named": found,
        "studies.shares.run_share": lambda *a, **k: Shared(0, 0),
        "studies.study.Study.run": lambda *a, **k: nothing,
        "studies.study.last_steps": lambda plans: (),
    }
    for name, stub in empty.items():
        monkeypatch.setattr(f"sainet.{name}", stub)


def next_iteration(state, batch):
    """A gradient step that changes no weight."""
    return eqx.tree_at(lambda s: s.iteration, state, state.iteration + 1), jnp.ones(())


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p in TEXTS if not is_run_by_the_site(p)])
def test_the_commands_of_a_page_run(page, workplace, without_what_takes_long):
    for name in filter(None, (AFTER.get(page), page)):
        run_all(name)


@pytest.mark.parametrize("page", [page for page, found in PROGRAMS.items() if found])
def test_the_programs_of_a_page_run(page, workplace, monkeypatch):
    if page in PROGRAMS_AFTER:
        run_all(PROGRAMS_AFTER[page])
    else:
        run("sainet generate --out runs/table-3")
    pushes = sn.open_pushes(next((workplace / "runs").iterdir()))
    travel = sn.evaluate(["physics"], pushes).measured.data["travel_mm"].values
    made = structs.replace(
        TRACKS["table-3"],
        hash=benchmark.hash_of(pushes),
        travel_mm=tuple(travel.mean(axis=0).tolist()),
    )
    monkeypatch.setattr(benchmark, "tracks", lambda: {**TRACKS, "table-3": made})
    # Those run in api/test_programs.py and in studies/test_cross_validation.py.
    fits = {"identify": "physics", "tune": "sain", "cross_validate": Mock()}
    for name, result in fits.items():
        stub = create_autospec(getattr(sn, name), return_value=result)
        monkeypatch.setattr(sn, name, stub)
    given = {"sn": sn, "np": np, "pushes": pushes}
    given["my_model"] = lambda batch: np.asarray(batch.truth)[..., :3]
    (workplace / "results" / "entries").mkdir(parents=True)
    exec(compile(PROGRAMS[page], page, "exec"), given)
