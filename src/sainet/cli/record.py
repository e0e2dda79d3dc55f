"""`sainet record`."""

from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from sainet.cli.devices import use_cache
from sainet.cli.output import Json, Output, progress_bar
from sainet.control.config import CollectConfig


@dataclass(frozen=True, kw_only=True)
class Record:
    """Record pushes with a robot, and make a dataset of them."""

    config: CollectConfig = field(default_factory=CollectConfig)
    out: Path
    """Run folder to write, one file per push and the folder dataset; identical settings
    resume."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Record the pushes and import them."""
        self.config.check_used()
        use_cache()
        from sainet.control.collect import DATASET, collect, rehearse, summary_of

        with progress_bar("Pushing", self.config.pushes, self.output) as advance:

            def on_pushes(pushes: int) -> None:
                advance(pushes, "")

            if self.config.dry_run:
                rehearse(self.config, on_pushes=on_pushes)
                return {"dry_run": True, "pushes": self.config.pushes}
            store = collect(self.config, self.out, on_pushes=on_pushes)
        found = summary_of(self.out)
        for reason, count in found.troubles.items():
            self.output.warn(f"{count} pushes are not in the dataset: {reason}.")
        where = self.out / DATASET
        self.output.say(f"{store.info.pushes} pushes are in {where}")
        counts = msgspec.to_builtins(found)
        del counts["seal"]
        return {"out": str(self.out), "data": str(where), **counts}
