"""Run the commands whose figures stand in docs/results.md, and write them there.

    python tools/results.py [SECTION ...]

Each section is a command, its figures and the machine; none is typed by hand. Finished
runs are not made again, nor those whose receipts are kept (tools/receipts.py). Sections
that are not named stay as they stand in the page.
Recorded pushes are looked for in ../shared/data or $SAINET_DATA.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from headlines import main as write_headlines
from readings import ERRORS, FINAL_ERRORS, of_control, of_errors, of_groups
from receipts import RECEIPTS, keep, restore

from sainet.control.record import episode_file, read_record
from sainet.identification.parameters import CAMERA
from sainet.learning.recipes import PAPER, RESIDUAL
from sainet.models.library import OF_STROKES
from sainet.report.control_table import control_markdown
from sainet.report.figures.video import write_film
from sainet.report.tables import to_markdown
from sainet.runs.manifest import manifest

ROOT = Path(__file__).resolve().parent.parent
SAINET = str(Path(sys.executable).with_name("sainet"))
RUNS = Path("runs/results")
_LEVEL = 0.02  # two scores closer than this are level
PAGE = ROOT / "docs" / "results.md"
FIGURES = ROOT / "docs" / "figures"


def main() -> None:
    """Measure what is asked for and write it into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=str([*SECTIONS]))
    chosen = parser.parse_args().sections
    unknown = set(chosen) - SECTIONS.keys()
    if unknown:
        parser.error(f"no section {sorted(unknown)[0]!r}; there are {[*SECTIONS]}")
    parts = _standing()
    restore(RECEIPTS, ROOT / RUNS)
    for name in chosen or SECTIONS:
        title, write = SECTIONS[name]
        parts[title] = f"## {title}\n\n{write().strip()}\n"
        ordered = [parts[title] for title, _ in SECTIONS.values() if title in parts]
        PAGE.write_text("\n".join([_head(), *ordered]), "utf-8")
        keep(ROOT / RUNS, RECEIPTS)
    write_headlines()


def _standing() -> dict[str, str]:
    """Return the sections of the page as it stands, by title."""
    text = PAGE.read_text("utf-8") if PAGE.is_file() else ""
    sections = ["## " + part.strip() + "\n" for part in text.split("\n## ")[1:]]
    return {section.split("\n")[0].removeprefix("## "): section for section in sections}


def _recorded_folder() -> Path:
    return Path(os.environ.get("SAINET_DATA", ROOT / "../shared/data")) / "mitpush"


def _run(*words: str) -> dict[str, Any]:
    command = [SAINET, *words, "--json", "--quiet"]
    done = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout.splitlines()[-1])


def _reproduce(name: str, *more: str) -> tuple[str, ...]:
    """Return the command that makes a table at the paper's scale."""
    return ("reproduce", name, "--scale", "paper", "--out", str(RUNS), *more)


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


def _imported() -> Path:
    data = RUNS / "recorded"
    file = _recorded_folder() / "ellip1_endpoints.csv"
    _run("import", "mitpush-endpoints", str(file), "--out", str(data))
    return data


def _recorded() -> str:
    data = _imported()
    words = ("evaluate", "--model", "physics", *OF_STROKES, "--data", str(data))
    strokes = RUNS / "strokes-paper" / "test"
    made = ("--speed-mm-s", "10", "--pushes", "200", "--seed", "5")
    _run("generate", *_KIND.split(), *made, "--out", str(strokes))
    models = ("physics", "physics-true", *OF_STROKES)
    simulated = ("evaluate", "--model", *models, "--data", str(strokes), "--steps", "0")
    return (
        f"`sainet import mitpush-endpoints ellip1_endpoints.csv --out {data}`; then "
        f"`sainet {' '.join(words)}`: the networks that ship have seen simulated "
        f"pushes of this kind and none of these.\n\n{to_markdown(_run(*words))}\n"
        "The contact friction of 0.25 is `mu` in a published log of the same robot and "
        "what an earlier sweep on these same pushes chose: it is no blind guess.\n\n"
        "The same networks on simulated strokes, whose truth is this engine: physics "
        "is right there, and what a network adds is its own error (`sainet generate "
        f"{_KIND} {' '.join(made)}`):\n\n"
        f"{to_markdown(_run(*simulated))}"
    )


def _tuning() -> str:
    words = _reproduce("fine-tuning")
    choices = _run(*words)["choices"]
    robots = list(choices[0]["scores"])
    lines = [
        f"| pushes | way | {' | '.join(robots)} | mean |",
        "| --: | :-- |" + " --: |" * (len(robots) + 1),
    ]
    lines += [
        f"| {choice['pushes']} | from `{choice['start']}`, "
        f"{_changed(choice['change'])} | "
        + " | ".join(f"{choice['scores'][robot]:.3f}" for robot in robots)
        + f" | {choice['score']:.3f} |"
        for choice in choices
    ]
    named = dict.fromkeys(k for c in choices for k in c["change"])
    usual = ", ".join(
        "l2 1 / pushes"
        if name == "l2"
        else f"{_told(name)} {RESIDUAL.settings()[name]}"
        for name in named
    )
    return (
        f"`sainet {' '.join(words)}`: tuned on simulated pushes, of which the ends "
        "alone are seen, and compared on 300 others; the score is the mean error over "
        "that of physics, one training each. A table adds to every end a smooth random "
        "function of place, direction and side (standard deviations of 1.2 mm and 5 "
        "degrees where a disk goes as far as the pusher, no mean), which only `place` "
        "can know. Ends that are trained on also scatter "
        "by 1.1 mm and 3 degrees, and one in twenty failed. `unidentified` has a "
        "friction of contact (0.4) that the engine does not know (0.25); of the others "
        "it knows everything, and ends lie off by smooth random functions of the angle "
        "at which the pusher meets the disk (0.6 mm and 5.5 degrees). Defaults with "
        f"`engine`: {usual}.\n\n" + "\n".join(lines)
    )


def _changed(change: dict[str, Any]) -> str:
    return ", ".join(f"{_told(k)} {v}" for k, v in change.items()) or "the defaults"


def _recorded_pushes() -> str:
    words = _reproduce("recorded-pushes", "--recorded", str(_imported()))
    found = _run(*words)
    drawn = RUNS / "recorded-pushes-paper" / "engine-errors.svg"
    figure = _figure(drawn, "What engines get wrong")
    return (
        f"`sainet {' '.join(words)}`: real pushes, five folds by surface, contact and "
        "direction, so that repeats never straddle; a model of its own for each "
        "surface, unless its name says `for-all`. Intervals are over folds and pushes. "
        "`tuned`: from the network of simulated strokes; `residual`: added to the "
        "engine, nothing at first, these pushes alone (`--start engine`); `real`: "
        "these pushes alone, in the paper's form; "
        "`identified`: around the engine identified on the same training pushes; "
        "`place`: sees where on the table it is. The settings of `residual` are what "
        "simulated robots chose, but not blindly: how widely their pushes scatter was "
        "taken from these, and folds of these were looked at on the way.\n\n"
        f"{to_markdown(found)}\n{figure}\n\nWhat an engine misses of the end of a "
        "push: by where the disk was, and by the direction of the push on the table; "
        "nominal, and identified on these same pushes."
    )


def _recorded_efficiency() -> str:
    more = ("--recorded", str(_imported()))
    return _table(
        "recorded-data-efficiency",
        "tuned on 25 to 400 training pushes of a surface, the fewer among the more; "
        "five folds as above. Plywood has some 209 to train on and gives all of them "
        "where 400 are asked for.",
        figure="recorded-data-efficiency",
        more=more,
    )


def _table(
    name: str,
    said: str,
    *,
    reading: Callable[[Mapping[str, Any]], str] | None = None,
    figure: str = "",
    more: tuple[str, ...] = (),
) -> str:
    """Return the table of an experiment, what is said of it, and its figure if any."""
    words = _reproduce(name, *more)
    table = _run(*words)
    parts = [f"`sainet {' '.join(words)}`: {said}"]
    parts += [reading(table)] if reading else []
    parts += [to_markdown(table)]
    if figure:
        drawn = RUNS / f"{name}-paper" / f"{figure}.svg"
        parts.append(_figure(drawn, "Errors over training pushes"))
    return "\n\n".join(parts)


def _figure(drawn: Path, told: str) -> str:
    """Copy a figure that a command drew to the page's, and return what shows it."""
    FIGURES.mkdir(exist_ok=True)
    shutil.copyfile(ROOT / drawn, FIGURES / drawn.name)
    return f"![{told}](figures/{drawn.name})"


def _identified() -> str:
    data = _imported()
    lines = [
        f"| pushes | {' | '.join(_told(name) for name in _OF_ONE_DISK)} | not told "
        "| position (mm) | rotation (deg) |",
        f"| :-- |{' --: |' * len(_OF_ONE_DISK)} :-- | --: | --: |",
    ]
    for group in (None, "abs-10", "abs-20", "plywood-10"):
        out = RUNS / f"identified-{group or 'all'}"
        words = () if group is None else ("--group", group)
        found = _run("identify", "--data", str(data), *words, "--out", str(out))
        lines.append(_identified_row(group or "all", found))
    return (
        f"`sainet identify --data {data} [--group GROUP] --out DIR`: contact friction "
        "(0.25 before), table friction and pressure distribution (0.667, uniform, "
        "before) of the planar engine, and where the camera sees the disk (mm from "
        "where the robot has it; 0 before), fitted to where the disk ended; 95 % "
        "intervals over pushes. Errors are mean final errors before and after, on "
        "the same pushes that were fitted: no test of anything new.\n\n"
        + "\n".join(lines)
    )


_OF_ONE_DISK = ("pusher_friction", "pressure_radius_ratio", *CAMERA)


def _told(name: str) -> str:
    return name.replace("_", " ")


def _identified_row(group: str, found: dict[str, Any]) -> str:
    known = {estimate["name"]: estimate for estimate in found["estimates"]}
    cells = [
        "{value:.3f} [{low:.3f}, {high:.3f}]".format(**known[name])
        for name in _OF_ONE_DISK
    ]
    doubts = [_told(name) for name, estimate in known.items() if estimate["doubt"]]
    errors = [
        f"{found[f'before_{unit}']:.2f} to {found[f'after_{unit}']:.2f}"
        for unit in ("mm", "deg")
    ]
    row = [f"{group} ({found['pushes']})", *cells, ", ".join(doubts), *errors]
    return f"| {' | '.join(row)} |"


def _regularisation() -> str:
    words = _reproduce("regularisation")
    found = _run(*words)
    scores = [f"| {c['l2']:g} | {c['score']:.4f} |" for c in found["choices"]]
    least = min(found["choices"], key=lambda choice: choice["score"])
    return (
        f"`sainet {' '.join(words)}`: IN and SAIN on 4,500 pushes of the robot setup "
        "(Bullet), one training each, compared on 500 validation pushes that are "
        "neither trained nor tested on. The score is the mean error over that of "
        "physics.\n\n| l2 | score |\n| --: | --: |\n" + "\n".join(scores) + "\n\n"
        f"The least is at {least['l2']:g}. "
        f"{_choice(found['choices'])}\n\n{to_markdown(found)}"
    )


def _choice(choices: list[dict[str, float]]) -> str:
    usual = next(c for c in choices if c["l2"] == PAPER.objective.l2)
    least = min(choice["score"] for choice in choices)
    above = usual["score"] / least - 1
    if above == 0:
        return "It is the default."
    said = f"The default, {PAPER.objective.l2:g}, is {above:.1%} above it"
    if above >= _LEVEL:
        return f"{said}."
    return f"{said} and stays: with one training each, that is no difference to act on."


_KIND = (
    "robot --disks 1 --mass-kg 0.85 0.95 --radius-mm 52.5 --stroke-mm 50 "
    "--direction-deg 80 --gap-mm 1 --hold-steps 40 --tracking-mm 0"
)


def _control() -> str:
    words = _reproduce("simulated-control")
    table = _run(*words)
    return (
        f"`sainet {' '.join(words)}`: 100 goals each (50 with nominal properties alone "
        "and 50 with three disks), Bullet with noise as the world, disks of 0.9 and "
        "1.0 kg, 54 and 59 mm; planar inside every model, networks as they ship "
        "(trainings of their own, not those of Table III). Simulated, all of it. "
        "Published rows are the paper's, of 25 goals. Below the table: every pair that "
        "differs in what was solved; of the other two measures the pairs with p < "
        "0.05, of 72, so that some are chance. Decision times are of as many trials at "
        "once as there are cores, one core each; of a decision that has them all, see "
        "Benchmarks.\n\n"
        f"{of_control(table)}\n\n{control_markdown(table)}\n{_episodes()}"
    )


def _episodes() -> str:
    """Draw three episodes, and the film of the first, which the README shows."""
    out = RUNS / "control"
    words = ("control", "--goals", "hard", "--planner", "tree", "--world", "bullet")
    words += ("--trials", "3", "--out", str(out))
    _run(*words)
    write_film(read_record(episode_file(ROOT / out, 0)), FIGURES / "episode.gif")
    return (
        f"The first three hard goals, `sainet {' '.join(words)}`: disks at the start "
        "transparent, at the end solid, with the paths of their centres; disk 1 red, "
        "disk 2 blue, its centre a white cross in the target region. The "
        "[first of them](figures/episode.gif) moves.\n\n"
        f"{_figure(out / 'episodes.svg', 'SAIN pushes disk 2 to three hard goals')}"
    )


def _parity() -> str:
    words = ("reproduce", "engine-parity", "--out", str(RUNS))
    return (
        f"`sainet {' '.join(words)}`: 200 random pushes of each setup, truth Bullet "
        "without noise, every engine with the true properties. `planar-0.67` has the "
        "default pressure ratio; `bullet-at-45-deg` is Bullet in a scene that was "
        "turned by 45 degrees, its answer turned back.\n\n"
        f"{to_markdown(_run(*words))}"
    )


def _bench() -> str:
    lines = []
    for case in ("training", "engines", "planning"):
        figures = _run("bench", case)
        lines.append(f"`sainet bench {case} --json`\n")
        lines.append("| figure | value |\n| :-- | --: |")
        lines += [f"| `{k}` | {_short(v)} |" for k, v in figures.items()]
        lines.append("")
    return "\n".join(lines)


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


_BULLET = ("--engine", "bullet", "--assumed-engine", "bullet", "planar")
_TIMED = {  # the words of a command, and how often it is timed
    ("generate", "robot", "--pushes", "4500"): 3,
    ("generate", "robot", "--pushes", "4500", *_BULLET): 3,
    ("train", "sain", "--data", str(RUNS / "timing" / "generate")): 3,
    ("demo",): 3,
}


def _speed() -> str:
    rows = [("`sainet --help`", *_several(5, SAINET, "--help"))]
    for words, runs in _TIMED.items():
        out, times = RUNS / "timing" / words[0], []
        for _ in range(runs):
            shutil.rmtree(ROOT / out, ignore_errors=True)
            times.append(_seconds(SAINET, *words, "--out", str(out), "--quiet"))
        rows.append((f"`sainet {' '.join(words)}`", *_median(times)))
    shutil.rmtree(ROOT / RUNS / "timing")
    lines = [f"| {name} | {value:.2f} | {runs} |" for name, value, runs in rows]
    head = "| command | seconds (median) | runs |\n| :-- | --: | --: |"
    return "\n".join([head, *lines])


def _several(runs: int, *command: str) -> tuple[float, int]:
    return _median([_seconds(*command) for _ in range(runs)])


def _median(times: list[float]) -> tuple[float, int]:
    return sorted(times)[len(times) // 2], len(times)


_FIVE = (
    "five trainings of each network on 4,500 pushes of two disks, 10,000 iterations "
    "each; truth is Bullet with noise, and so is the engine of the rows Physics and "
    "Physics, true properties. SAIN around Bullet is the paper's SAIN; SAIN has the "
    "planar engine inside, told the same wrong masses and radii; SAIN, true properties "
    "the planar engine told the true ones. Published rows are the paper's, whose "
    "noise, friction of contacts and way to push are not known: ours were chosen "
    "before any result (`docs/theory.md`, section 10), and section 11 says "
    "what of the published size of Physics could not be reproduced."
)
_FORCE = "Of 480 steps of a push the first 200 are trained on and evaluated."
_TOLD = (
    "the networks of Table III on pushes unlike those that they were trained on. "
    "*properties ±p %*: every model is told masses and radii of which each is wrong by "
    "exactly p %, up or down by chance, the test pushes are the same. *angles "
    "outside*: contact angles up to 75 and directions up to 45 degrees, of which those "
    "beyond the trained 60 or 30 are kept. *25 mm/s*, *100 mm/s*: trained at 50. *2 mm "
    "apart*: disks lie 2 mm from each other, and the pusher from disk 1, so that 2 of "
    "the 10 mm of the push go through air; in training all touch."
)

SECTIONS = {
    "table-1": (
        "Table I: direct force, two disks",
        partial(
            _table, "direct-force-two-disks", f"{_FIVE} {_FORCE}", reading=of_errors
        ),
    ),
    "table-2": (
        "Table II: direct force, three disks",
        partial(
            _table,
            "direct-force-three-disks",
            f"the networks of Table I, which have seen two disks alone; {_FIVE} "
            f"{_FORCE} Only pairs of disks within 20 mm act on each other in the "
            "networks (`interaction.REACH`); the paper lets all act. Networks that "
            "have seen two disks alone know none that does not act; most of their "
            "error here comes from that, as an experiment shows (`docs/theory.md`, "
            "Beside a bystander). Those of names that end in *bystander* went on for "
            "300 iterations on the same two-disk pushes with a third disk beside each, "
            "which nothing touches (`sainet add-bystander`).",
            reading=of_errors,
        ),
    ),
    "table-3": (
        "Table III: robot, two disks",
        partial(_table, "robot-two-disks", _FIVE, reading=of_errors),
    ),
    "data-efficiency": (
        "How many simulated pushes",
        partial(
            _table,
            "data-efficiency",
            "IN and SAIN on the robot setup, Bullet as the truth; three trainings "
            "each, of 2,500 iterations, so that what differs is the data. In groups "
            "of their own, outside of the figure: five other trainings on 500 pushes, "
            "asked for after the first three, of which every SAIN was better than "
            "every IN in the position of disk 2, and which were too few for an "
            "interval to say so; and the first three of Table III, of 10,000.",
            reading=partial(of_groups, errors=ERRORS | FINAL_ERRORS),
            figure="data-efficiency",
        ),
    ),
    "recurrent": (
        "Trained on whole pushes or on single steps",
        partial(
            _table,
            "recurrent-or-not",
            "the paper's figure 2d against 2c on the robot setup, Bullet as the truth; "
            "three trainings each. Single steps start from the true state and end at "
            "the true one, without the noise of motion capture that poses have "
            "otherwise.",
            reading=partial(
                of_groups,
                against={
                    "in-single-steps": ("in",),
                    "sain-single-steps": ("sain",),
                },
            ),
        ),
    ),
    "robustness": (
        "Outside of what was told and trained",
        partial(
            _table,
            "robustness",
            _TOLD,
            reading=of_groups,
        ),
    ),
    "regularisation": ("The choice of l2", _regularisation),
    "recorded": ("Recorded pushes (real), planar engine", _recorded),
    "identified": ("Recorded pushes (real), engine identified", _identified),
    "tuning": ("How to fine-tune, chosen on simulated pushes", _tuning),
    "recorded-pushes": (
        "Calibrate or learn, on recorded pushes (real)",
        _recorded_pushes,
    ),
    "recorded-data-efficiency": (
        "How many recorded pushes (real)",
        _recorded_efficiency,
    ),
    "control": ("Control in simulation", _control),
    "parity": ("Planar against Bullet", _parity),
    "bench": ("Benchmarks", _bench),
    "speed": ("Whole commands", _speed),
}

if __name__ == "__main__":
    main()
