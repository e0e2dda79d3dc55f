"""`sainet demo`."""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from sainet.cli.devices import use_devices
from sainet.cli.output import Output
from sainet.cli.progress import progress_bar
from sainet.runs.workers import worker_pool
from sainet.studies.config import DemoConfig


@dataclass(frozen=True, kw_only=True)
class Demo:
    """Run the whole method at small scale: simulate, train, compare, push to goals."""

    out: Path = Path("runs/demo")
    """Run folder to write, with report.html."""
    config: DemoConfig = field(default_factory=DemoConfig)
    devices: int | None = None
    """Number of CPU devices that share a batch. Default: one per core."""
    output: Output = field(default_factory=Output)

    def run(self) -> dict[str, Any]:
        """Run the demo."""
        use_devices(self.devices)
        from sainet.evaluation.as_json import to_json_object
        from sainet.report.arrange import arrange
        from sainet.report.writers import print_table
        from sainet.studies.chain import Chain
        from sainet.studies.demo import run_demo

        with worker_pool(None) as pool:
            bar = partial(progress_bar, output=self.output)
            say = partial(self.output.say, markup=True)
            chain = Chain(self.out, pool, say, bar)
            result = run_demo(self.config, chain)
        print_table(arrange(result.summary), self.output.console)
        self.output.say(f"Open {result.report} in a browser: it plays.")
        return {"report": str(result.report), **to_json_object(result.summary)}
