"""`sainet split`."""

from dataclasses import dataclass, field
from pathlib import Path

from sainet.cli.output import Json, Output


@dataclass(frozen=True, kw_only=True)
class Split:
    """Divide recorded pushes into training pushes and test pushes.

    Repeats stay together. Train on OUT/train, evaluate on OUT/test. For simulated
    pushes generate a test dataset with another seed instead.
    """

    data: Path
    """Dataset to divide."""
    out: Path
    """Folder for the datasets train and test; identical settings resume."""
    test: float = 0.2
    """Share of the test pushes."""
    seed: int = 0
    """Random seed of the draw."""
    chains: bool = False
    """Keep recorded chains together: pushes that start where another push ended."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Write both datasets."""
        from sainet.datasets.splits import write_split
        from sainet.datasets.store import open_store

        parts = write_split(
            open_store(self.data),
            self.out,
            test=self.test,
            seed=self.seed,
            chains=self.chains,
        )
        train, test = (part.info.pushes for part in parts)
        self.output.say(f"{train} training pushes and {test} test pushes: {self.out}")
        return {"out": str(self.out), "train": train, "test": test}
