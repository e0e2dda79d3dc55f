"""Keep what took hours to make, and put it back where commands look for it.

    python tools/receipts.py keep      # what is in runs/results, into receipts/
    python tools/receipts.py restore   # what is in receipts/, into runs/results

Of a training it keeps the network, its card and its log; of trials what became of every
goal, without the pushes. With them back in place a table is made again in minutes, for
finished steps are not run again. Neither writes over what is finished.
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sainet.control.record import SUMMARY, episode_file
from sainet.learning.log import LOG
from sainet.models.card import CARD, WEIGHTS
from sainet.runs.documents import read_json, write_bytes, write_json
from sainet.runs.folders import CONFIG
from sainet.runs.manifest import MANIFEST

ROOT = Path(__file__).resolve().parent.parent
RUNS, RECEIPTS = ROOT / "runs" / "results", ROOT / "receipts"
# Folders of experiments whose trainings, or trials, take hours.
TRAININGS, TRIALS = ("direct-force-paper", "robot-paper"), "simulated-control-paper"
_TRAINING = (CONFIG, MANIFEST, LOG, WEIGHTS, CARD)  # the card last: it says, finished
_TRIALS = (CONFIG, MANIFEST)


def main() -> None:
    """Do what is asked for, and say what was written."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("verb", choices=("keep", "restore"))
    verb = parser.parse_args().verb
    written = keep(RUNS, RECEIPTS) if verb == "keep" else restore(RECEIPTS, RUNS)
    print("\n".join(str(path.relative_to(ROOT)) for path in written) or "Nothing new.")


def keep(runs: Path, receipts: Path) -> list[Path]:
    """Keep the steps that are finished; returns what was written."""
    return [*_trainings(runs, receipts), *_keep_trials(runs, receipts)]


def restore(receipts: Path, runs: Path) -> list[Path]:
    """Put back the steps that are not there; returns what was written."""
    return [*_trainings(receipts, runs), *_restore_trials(receipts, runs)]


def _trainings(here: Path, there: Path) -> Iterator[Path]:
    """Copy finished trainings to where they are not finished."""
    for card in (path for name in TRAININGS for path in here.glob(f"{name}/*/{CARD}")):
        to = there / card.parent.relative_to(here)
        if not (to / CARD).exists():
            for name in _TRAINING:
                write_bytes(to / name, (card.parent / name).read_bytes())
            yield to


def _keep_trials(runs: Path, receipts: Path) -> Iterator[Path]:
    for summary in sorted((runs / TRIALS).glob(f"*/{SUMMARY}")):
        folder = summary.parent
        to = receipts / TRIALS / f"{folder.name}.jsonl"
        if not to.exists():
            made = {name: read_json(folder / name) for name in _TRIALS}
            files = [folder / name for name in read_json(summary)["episodes"]]
            lines = [made, *(_without_pushes(read_json(path)) for path in files)]
            write_bytes(to, "".join(map(_line, lines)).encode())
            yield to


def _without_pushes(record: dict[str, Any]) -> dict[str, Any]:
    seconds = [round(second, 4) for second in record["decision_s"]]
    return record | {"turns": [], "decision_s": seconds}


def _line(value: dict[str, Any]) -> str:
    return json.dumps(value, sort_keys=True, allow_nan=False) + "\n"


def _restore_trials(receipts: Path, runs: Path) -> Iterator[Path]:
    for path in sorted((receipts / TRIALS).glob("*.jsonl")):
        to = runs / TRIALS / path.stem
        if not (to / SUMMARY).exists():
            made, *records = map(json.loads, path.read_text("utf-8").splitlines())
            files = [episode_file(to, index) for index in range(len(records))]
            for name, value in (*made.items(), *zip(files, records, strict=True)):
                if not (to / name).exists():  # what was run here has its pushes too
                    write_json(to / name, value)
            told = {"episodes": [str(file.relative_to(to)) for file in files]}
            write_json(to / SUMMARY, told)
            yield to


if __name__ == "__main__":
    main()
