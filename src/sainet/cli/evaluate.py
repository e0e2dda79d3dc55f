"""`sainet evaluate`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sainet.cli.devices import use_devices
from sainet.cli.output import Output
from sainet.cli.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Measure the errors of several models on the same stored pushes."""

    model: tuple[str, ...] = ("physics", "physics-calibrated")
    """physics, physics-calibrated, or folders of trained networks."""
    data: Path
    """Dataset to predict."""
    steps: int | None = None
    """Steps to predict, 0 for all; default: 200, all of recorded pushes."""
    force: bool = False
    """Use networks on other pushes than they were trained for."""
    devices: int | None = None
    """CPU devices to split a batch over; default: one a core."""
    output: Output = field(default_factory=Output)

    def run(self) -> dict[str, Any]:
        """Evaluate the models and print the table."""
        use_devices(self.devices)
        from sainet.datasets.store import open_store
        from sainet.evaluation.evaluate import evaluate
        from sainet.models.registry import load_dynamics
        from sainet.viz.tables import print_table

        store = open_store(self.data)
        models = [load_dynamics(name) for name in self.model]
        total = store.info.pushes * len(models)
        with progress_bar("Predicting", total, self.output) as advance:
            result = evaluate(
                models,
                store,
                steps=self.steps,
                force=self.force,
                on_pushes=lambda model, pushes: advance(pushes, model),
            ).to_dict()
        print_table(result, self.output.console)
        return result
