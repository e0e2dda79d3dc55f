"""`sainet identify`."""

import shlex
from dataclasses import dataclass, field
from pathlib import Path

from sainet.cli.devices import use_devices
from sainet.cli.output import Json, Output, progress_bar


@dataclass(frozen=True, kw_only=True)
class Identify:
    """Estimate the planar engine's parameters and the camera offset from pushes."""

    data: Path
    """Dataset of recorded pushes or of the robot setup; poses before and after each
    push are enough."""
    out: Path
    """Run folder to write, usable as a model."""
    group: str | None = None
    """Group of the pushes, for example abs-10, or their surface (default: all)."""
    pushes: int | None = None
    """Pushes to use, from the start of the dataset (default: all)."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Identify the parameters and print those that are not identifiable."""
        use_devices(None)
        from sainet.datasets.store import open_part
        from sainet.identification.identify import identify_into
        from sainet.report.writers import print_estimates

        store = open_part(self.data, self.group, self.pushes)
        title = f"Fitting to {store.info.pushes} pushes"
        with progress_bar(title, None, self.output) as advance:
            found = identify_into(
                store, self.out, on_try=lambda error: advance(1, f"error {error:.3f}")
            )
        print_estimates(found, self.output.console)
        words = ("evaluate", "--model", "physics-true", str(self.out), "--data", "TEST")
        self.output.say(f"Compare on other pushes: sainet {shlex.join(words)}")
        return {"out": str(self.out), **found.to_json()}
