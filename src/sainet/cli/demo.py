"""`sainet demo`."""

from dataclasses import dataclass, field
from pathlib import Path

from sainet.cli.devices import use_devices
from sainet.cli.output import Bars, Json, Output, command_of
from sainet.runs.workers import worker_pool
from sainet.studies import DemoConfig


@dataclass(frozen=True, kw_only=True)
class Demo:
    """Run the whole method at small scale: simulate, train, compare, push to goals."""

    out: Path = Path("runs/demo")
    """Run folder to write, with report.html."""
    config: DemoConfig = field(default_factory=DemoConfig)
    devices: int | None = None
    """Number of CPU devices that share a batch. Default: one per core."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Run the demo."""
        use_devices(self.devices)
        from sainet.evaluation.as_json import to_json_object
        from sainet.report.arrange import arrange
        from sainet.report.writers import print_table
        from sainet.studies.demo import run_demo
        from sainet.studies.runner import Runner
        from sainet.studies.study import STEPS

        with worker_pool(None) as pool, Bars(self.output) as bars:
            runner = Runner(self.out / STEPS, pool, bars)
            command = command_of("demo", self.config, out=self.out)
            result = run_demo(self.config, self.out, runner, self.output.say, command)
        print_table(arrange(result.summary), self.output.console)
        self.output.say(f"Open {result.report} in a browser: it plays.")
        return {"report": str(result.report), **to_json_object(result.summary)}
