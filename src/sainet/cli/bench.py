"""`sainet bench`."""

from dataclasses import dataclass, field
from typing import Any

from tyro.conf import Positional

from sainet.cli.devices import use_devices
from sainet.cli.output import Output


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Measure how fast this machine is at the heavy parts."""

    cases: Positional[tuple[str, ...]] = ()
    """training, engines, planning; default: all."""
    devices: int | None = None
    """CPU devices to split a batch over; default: one a core."""
    output: Output = field(default_factory=Output)

    def run(self) -> dict[str, Any]:
        """Run the cases one after another; their figures stand side by side."""
        use_devices(self.devices)
        from sainet.bench import CASES, load_case

        figures: dict[str, Any] = {}
        for name in self.cases or tuple(CASES):
            case = load_case(name)
            self.output.say(f"Measuring {name} ...")
            found = case()
            figures |= found
            for key, value in found.items():
                self.output.console.print(f"  {key}: {value}")
        return figures
