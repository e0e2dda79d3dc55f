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
    with the shipped ones; robot-planar; engine-parity; fine-tuning (its settings,
    chosen on simulated pushes); recorded-pushes and recorded-data-efficiency, which
    need --recorded. Default: all that can be made."""
    scale: Scale = "quick"
    """quick: minutes. paper: 4,500 pushes and 10,000 iterations."""
    out: Path = Path("runs/reproduce")
    """Folder to write, a folder in it for each experiment."""
    recorded: Path | None = None
    """Dataset of recorded pushes: what 'sainet import mitpush-endpoints' made."""
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
            for name in self.experiments or self._possible(tuple(EXPERIMENTS)):
                folder = self.out / f"{name}-{self.scale}"
                chain = Chain(folder, pool, self.output.say, bar, self.recorded)
                tables[name] = load_experiment(name)(self.scale, chain)
                show = print_control if is_control(tables[name]) else print_table
                show(tables[name], self.output.console)
        only = next(iter(tables.values()))
        return only if len(tables) == 1 else {"experiments": tables}

    def _possible(self, experiments: tuple[str, ...]) -> tuple[str, ...]:
        """Leave out what needs recorded pushes where none were given, and say so."""
        if self.recorded is not None:
            return experiments
        needy = [name for name in experiments if name.startswith("recorded-")]
        self.output.say(f"Left out without --recorded: {', '.join(needy)}.")
        return tuple(name for name in experiments if name not in needy)
