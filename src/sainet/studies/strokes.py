"""Simulated long pushes of one disk, like the recorded pushes, and their networks.

The paper's pushes last 0.2 s, recorded pushes up to 5 s, and a network trained only on
the former diverges long before the end of the latter. These networks are the paper's
networks, fine-tuned on simulated long pushes.

The disk has the properties of the recorded disk, which are also the assumed properties:
other disks would teach a network to correct an engine that is right. The pressure is
uniform. The pusher has no tracking error: that of the simulated robot (0.2 mm, 0.1 s)
has a velocity of about 14 mm/s, which hardly affects a push at 50 mm/s, but at 10 mm/s
breaks the friction and halves the rotation of the disk.
"""

from dataclasses import dataclass, replace

from sainet.datasets.config import GenerateConfig
from sainet.datasets.store import Store
from sainet.learning.recipes import PAPER, FromModel, ModelKind
from sainet.studies.chain import Chain
from sainet.studies.config import Scale
from sainet.worlds.noise_config import NoiseConfig

# The recorded directions go to 80 degrees, and the pusher starts a millimetre away.
STROKES = GenerateConfig(
    disks=1,
    pushes=2000,
    engine="planar",
    mass_kg=(0.85, 0.95),
    radius_mm=(52.5,),
    stroke_mm=(50.0,),
    speed_mm_s=(10.0, 50.0),
    direction_deg=80.0,
    gap_mm=1.0,
    hold_steps=40,
    noise=NoiseConfig(tracking_mm=0.0),
)
RECIPE = PAPER.changed(iterations=3000, batch_size=50, halve_every=750, steps=10_000)
SIZES = {"quick": (20, 20), "paper": (STROKES.pushes, RECIPE.optimiser.iterations)}
START_FROM: dict[str, ModelKind] = {"in-stroke": "in", "sain-stroke": "sain"}


@dataclass(frozen=True)
class StrokeSetup:
    """Simulated strokes and networks at one scale, in the folder of a chain."""

    scale: Scale
    chain: Chain

    def training_pushes(self) -> Store:
        """Return the strokes that networks are trained on."""
        pushes = SIZES[self.scale][0]
        config = replace(STROKES, pushes=pushes, chunk_size=min(250, pushes))
        return self.chain.simulate("train", config)

    def train(self, name: str) -> str:
        """Train a network from the shipped one; returns the name of its folder.

        Args:
            name: `in-stroke` or `sain-stroke`.
        """
        start, iterations = START_FROM[name], SIZES[self.scale][1]
        recipe = RECIPE.changed(start=FromModel(start), iterations=iterations)
        self.chain.train(start, self.training_pushes(), recipe, name=name)
        return name


def stroke_setup(scale: Scale, chain: Chain) -> StrokeSetup:
    """Return the setup whose folder lies beside that of the experiment."""
    shared = replace(chain, out=chain.out.parent / f"strokes-{scale}")
    return StrokeSetup(scale, shared)
