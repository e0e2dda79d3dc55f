"""Train the networks that ship with the package, and put them where it looks.

    python tools/pretrained.py [--scale paper] [--out runs/results] [--into FOLDER]

The paper's are trained as seed 0 of Table III is (`sainet reproduce robot-two-disks`):
what that has trained already is the same folder and is not trained again. Weights that
come from another machine or number of devices differ, so the networks that ship are
trainings of their own. Those of strokes go on from the paper's, as they are shipped:
who replaces some replaces all, and what docs/results/ says of them.
"""

import argparse
import shutil
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from sainet.cli.devices import use_devices
from sainet.cli.output import Output
from sainet.cli.progress import progress_bar
from sainet.runs.workers import worker_pool

if TYPE_CHECKING:
    from sainet.studies.chain import Chain
    from sainet.studies.paper_setup import PaperSetup
    from sainet.studies.strokes import StrokeSetup

SEED = 0


def main() -> None:
    """Train, or find trained, and copy."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", choices=("quick", "paper"), default="paper")
    parser.add_argument("--out", type=Path, default=Path("runs/results"))
    parser.add_argument("--into", type=Path)
    parser.add_argument("--devices", type=int)
    options = parser.parse_args()
    use_devices(options.devices)
    from sainet.models.library import PRETRAINED
    from sainet.studies.chain import Chain
    from sainet.studies.paper_setup import paper_setup
    from sainet.studies.strokes import stroke_setup

    output = Output()
    with worker_pool(None) as pool:
        bar = partial(progress_bar, output=output)
        chain = Chain(options.out / "pretrained", pool, output.say, bar)
        into = options.into or PRETRAINED
        build(paper_setup("robot", options.scale, chain), into)
        build_strokes(stroke_setup(options.scale, chain), into)


def build(setup: "PaperSetup", into: Path) -> None:
    """Copy card and weights of each of the paper's networks."""
    from sainet.models.library import OF_PAPER

    for name in OF_PAPER:
        (folder,) = setup.train((name,), (SEED,))[name]
        _ship(name, setup.chain, folder, into)


def build_strokes(setup: "StrokeSetup", into: Path) -> None:
    """Copy card and weights of each network of strokes."""
    from sainet.models.library import OF_STROKES

    for name in OF_STROKES:
        _ship(name, setup.chain, setup.train(name), into)


def _ship(name: str, chain: "Chain", folder: str, into: Path) -> None:
    from sainet.models.card import CARD, WEIGHTS, read_card
    from sainet.runs.documents import write_document

    target = into / name
    target.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(chain.out / folder / WEIGHTS, target / WEIGHTS)
    write_document(target / CARD, read_card(chain.out / folder))
    chain.say(f"{name} is in {target}")


if __name__ == "__main__":
    main()
