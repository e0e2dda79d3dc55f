"""`sainet reproduce`."""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from tyro.conf import Positional

from sainet.cli.devices import use_devices
from sainet.cli.output import Output
from sainet.cli.progress import progress_bar
from sainet.experiments.config import Scale
from sainet.processes import worker_pool


@dataclass(frozen=True, kw_only=True)
class Reproduce:
    """Make tables again, each step once: finished ones are not run again."""

    experiments: Positional[tuple[str, ...]] = ()
    """direct-force-two-disks (the paper's Table I), direct-force-three-disks (II) and
    robot-two-disks (III), with Bullet; data-efficiency, recurrent-or-not,
    regularisation and robustness with the networks of Table III; simulated-control
    with the shipped ones; robot-planar; engine-parity. Default: all."""
    scale: Scale = "quick"
    """quick: minutes. paper: 4,500 pushes and 10,000 iterations."""
    out: Path = Path("runs/reproduce")
    """Folder to write, a folder in it for each experiment."""
    devices: int | None = None
    """CPU devices to split a batch over; default: one a core."""
    output: Output = field(default_factory=Output)

    def run(self) -> dict[str, Any]:
        """Run the experiments one after another."""
        use_devices(self.devices)
        from sainet.experiments import EXPERIMENTS, load_experiment
        from sainet.experiments.chain import Chain
        from sainet.viz.control_table import is_control, print_control
        from sainet.viz.tables import print_table

        tables: dict[str, Any] = {}
        bar = partial(progress_bar, output=self.output)
        with worker_pool(None) as pool:
            for name in self.experiments or tuple(EXPERIMENTS):
                folder = self.out / f"{name}-{self.scale}"
                chain = Chain(folder, pool, self.output.say, bar)
                tables[name] = load_experiment(name)(self.scale, chain)
                show = print_control if is_control(tables[name]) else print_table
                show(tables[name], self.output.console)
        only = next(iter(tables.values()))
        return only if len(tables) == 1 else {"experiments": tables}
