"""`sainet add-bystander`."""

from dataclasses import dataclass, field
from pathlib import Path

from sainet.cli.devices import use_devices
from sainet.cli.output import Json, Output, progress_bar


@dataclass(frozen=True, kw_only=True)
class AddBystander:
    """Add a bystander, a disk that nothing touches, to each push of a dataset.

    Networks trained further on such pushes predict scenes of more disks better.
    """

    data: Path
    """Dataset of pushes with complete trajectories, for example simulated pushes."""
    out: Path
    """Run folder to write, a dataset."""
    seed: int = 0
    """Random seed of the masses, radii and places of the bystanders."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Write the dataset."""
        use_devices(None)
        from sainet.datasets.bystander import add_bystander
        from sainet.datasets.store import open_store
        from sainet.runs.errors import require

        require(self.seed >= 0, "seed", "at least 0", self.seed)
        store = open_store(self.data)
        total = store.info.pushes * len(store.info.assumed_engines)
        with progress_bar("Simulator predictions", total, self.output) as advance:
            found = add_bystander(
                store, self.out, seed=self.seed, on_pushes=lambda n: advance(n, "")
            )
        info = found.info
        self.output.say(f"{info.pushes} pushes of {info.bodies} disks: {self.out}")
        return {"out": str(self.out), "pushes": info.pushes, "disks": info.bodies}
