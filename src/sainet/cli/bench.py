"""`sainet bench`."""

from dataclasses import dataclass, field

from tyro.conf import Positional

from sainet.cli.devices import use_devices
from sainet.cli.output import Json, Output


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Measure the speed of training, engines and planning on this machine."""

    cases: Positional[tuple[str, ...]] = ()
    """Benchmark cases: training, engines, planning. Default: all."""
    devices: int | None = None
    """Number of CPU devices that share a batch. Default: one per core."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Run the cases one after another.

        Returns:
            The figures of one case; of several, an object of figures for each: some
            have figures of one name.
        """
        use_devices(self.devices)
        from rich.text import Text

        from sainet.bench import CASES, Figures, load_case

        # Every name is looked up before anything is measured.
        cases = {name: load_case(name) for name in self.cases or tuple(CASES)}
        figures: dict[str, Figures] = {}
        for name, case in cases.items():
            self.output.say(f"Measuring {name} ...")
            figures[name] = case()
            for key, value in figures[name].items():
                line = Text(f"  {key}: {value}")  # a value may look like markup
                self.output.console.print(line, soft_wrap=True)
        return figures if len(figures) > 1 else next(iter(figures.values()))
