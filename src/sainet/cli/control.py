"""`sainet control`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sainet.cli.devices import use_cache
from sainet.cli.output import Output
from sainet.cli.progress import progress_bar
from sainet.control.config import ControlConfig
from sainet.processes import worker_pool

_DRAWN = 6  # episodes


@dataclass(frozen=True, kw_only=True)
class Control:
    """Push the last disk to goals by pushing the first, in a simulated world."""

    config: ControlConfig = field(default_factory=ControlConfig)
    out: Path = Path("runs/control")
    """Run folder to write, a file for each episode; the same settings go on where they
    stopped."""
    workers: int | None = None
    """Processes; default: one a core. The result does not depend on it."""
    output: Output = field(default_factory=Output)

    def run(self) -> dict[str, Any]:
        """Run the trials and say how they went."""
        use_cache()
        from sainet.control.summary import summarise
        from sainet.control.trials import prepare, run_trials
        from sainet.viz.episodes import draw_episodes

        config = self.config
        prepare(config)
        solved = 0
        bar = progress_bar(f"Pushing ({config.model})", config.trials, self.output)
        with worker_pool(self.workers) as pool, bar as advance:

            def on_episode(record: dict[str, Any]) -> None:
                nonlocal solved
                solved += record["solved"]
                advance(1, f"{solved} solved")

            records = run_trials(config, self.out, executor=pool, on_episode=on_episode)
        figure = draw_episodes(records[:_DRAWN], self.out / "episodes.svg")
        found = summarise(records)
        low, high = found["interval"]
        self.output.say(
            f"{config.model}: {found['solved']} of {found['trials']} {config.goals} "
            f"goals solved (95 % interval {low:.0%} to {high:.0%}), median "
            f"{found['median_pushes']} pushes; episodes are in {self.out}, the first "
            f"{_DRAWN} drawn in {figure}"
        )
        names = {
            name: getattr(config, name)
            for name in ("model", "goals", "planner", "world")
        }
        return names | found | {"episodes": str(self.out / "episodes")}
