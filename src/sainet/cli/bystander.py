"""`sainet add-bystander`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sainet.cli.devices import use_devices
from sainet.cli.output import Output
from sainet.cli.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class AddBystander:
    """Lay one disk more beside each push, untouched: it teaches what does not act.

    A network that goes on from there does better among more disks than it was trained
    on: `sainet train sain --start-from sain --data OUT --out DIR`.
    """

    data: Path
    """Dataset of pushes whose paths are known all the way, simulated ones say."""
    out: Path
    """Run folder to write."""
    seed: int = 0
    """Of the masses, radii and places of the bystanders."""
    output: Output = field(default_factory=Output)

    def run(self) -> dict[str, Any]:
        """Write the dataset."""
        use_devices(None)
        from sainet.datasets.bystander import add_bystander
        from sainet.datasets.store import open_store
        from sainet.runs.errors import require

        require(self.seed >= 0, "seed", "at least 0", self.seed)
        store = open_store(self.data)
        total = store.info.pushes * len(store.info.assumed_engines)
        with progress_bar("Predicting s-bar", total, self.output) as advance:
            found = add_bystander(
                store, self.out, seed=self.seed, on_pushes=lambda n: advance(n, "")
            )
        info = found.info
        self.output.say(f"{info.pushes} pushes of {info.bodies} disks: {self.out}")
        return {"out": str(self.out), "pushes": info.pushes, "disks": info.bodies}
