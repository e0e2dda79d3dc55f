"""Train the networks that ship with the package, and put them where it looks.

    python tools/pretrained.py [--scale paper] [--out runs/results] [--into FOLDER]

They are seed 0 of Table III (`sainet reproduce robot-two-disks`): what that has
trained already, or trains later, is the same folder and is not trained again.
"""

import argparse
import shutil
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sainet.cli.devices import use_devices
from sainet.cli.output import Output
from sainet.cli.progress import progress_bar
from sainet.processes import worker_pool

if TYPE_CHECKING:
    from sainet.experiments.paper_setup import PaperSetup
    from sainet.models.card import Card

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
    from sainet.experiments.chain import Chain
    from sainet.experiments.paper_setup import paper_setup
    from sainet.models.registry import PRETRAINED

    output = Output()
    with worker_pool(None) as pool:
        bar = partial(progress_bar, output=output)
        chain = Chain(options.out / "pretrained", pool, output.say, bar)
        setup = paper_setup("robot", options.scale, chain)
        build(setup, options.into or PRETRAINED)


def build(setup: "PaperSetup", into: Path) -> None:
    """Copy card and weights of each shipped network into a folder of its name."""
    from sainet.models.card import CARD, WEIGHTS, read_card
    from sainet.models.registry import SHIPPED
    from sainet.runs import write_json

    for name in SHIPPED:
        (folder,) = setup.train(name, (SEED,))
        target = into / name
        target.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(setup.chain.out / folder / WEIGHTS, target / WEIGHTS)
        write_json(target / CARD, whole_card(read_card(setup.chain.out / folder)))
        setup.chain.say(f"{name} is in {target}")


def whole_card(card: "Card") -> dict[str, Any]:
    """Return a card with the settings that came after its training: their defaults."""
    config = {"recurrent": card.recurrent, **card.config}
    return card.to_dict() | {"config": config}


if __name__ == "__main__":
    main()
