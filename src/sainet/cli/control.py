"""`sainet control`."""

from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from sainet.cli.devices import use_cache
from sainet.cli.output import Json, Output, command_of, progress_bar
from sainet.control.config import ControlConfig
from sainet.runs.documents import read_json
from sainet.runs.errors import require
from sainet.runs.executors import Machines
from sainet.runs.manifest import MANIFEST

if TYPE_CHECKING:
    from sainet.control.record import EpisodeRecord
    from sainet.evaluation.trials import TrialRow

_DRAWN = 6  # episodes
# Settings that say where episodes were, in the result.
_PLACES = {
    "simulated": ("world",),
    "lab": ("robot", "lab", "surface", "swapped"),
    "abb": ("robot",),
}


@dataclass(frozen=True, kw_only=True)
class Control:
    """Push the target disk to goals by pushing disk 1, simulated or with a robot."""

    config: ControlConfig = field(default_factory=ControlConfig)
    out: Path = Path("runs/control")
    """Run folder to write, one file per episode; identical settings resume."""
    animate: bool = False
    """Also draw a film of the first episode (MP4 with the extra video, else GIF) and
    replay.html, a page that plays the first six episodes."""
    workers: int | None = None
    """Number of processes, which does not affect the result. Default: one per core."""
    machines: Machines = field(default_factory=Machines)
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Run the trials, or those of a shard, and print their outcome."""
        self.config.check_used()
        self.machines.refuse_with_shard(animate=self.animate)
        use_cache()
        from sainet.control.trials import measure_trials, prepare
        from sainet.evaluation.trials import trial_rows
        from sainet.evaluation.unlike import doubts_of_training
        from sainet.report.figures.episodes import draw_episodes

        config = self.config
        model, _ = prepare(config)
        for doubt in doubts_of_training(model.card, config.disks):
            self.output.warn(f"{config.model}: {doubt}.")
        if config.dry_run:
            return self._rehearse()
        records = self._run_trials()
        if (shard := self.machines.share) is not None:
            self.output.say(f"The episodes of shard {shard} are in {self.out}")
            return {"out": str(self.out), "shard": str(shard)}
        figure = self.out / "episodes.svg"
        if not figure.exists():
            draw_episodes(records[:_DRAWN], figure)
        if self.animate:
            self._animate(records[:_DRAWN])
        (row,) = trial_rows(measure_trials({model.id: records}))
        self.output.say(_outcome(config, row))
        drawn = f"the first {_DRAWN}" if config.trials > _DRAWN else "each"
        self.output.say(f"Episodes are in {self.out}, {drawn} drawn in {figure}.")
        names = {
            name: getattr(config, name)
            for name in ("model", "goals", "planner", *_PLACES[config.robot])
        }
        return names | row.to_dict() | {"episodes": str(self.out / "episodes")}

    def _run_trials(self) -> list["EpisodeRecord"]:
        """Return the records of all trials, or none of a shard."""
        from sainet.control.trials import run_share, run_trials

        config, shard, solved = self.config, self.machines.share, 0
        total = len(shard.own(config.trials)) if shard else config.trials
        bar = progress_bar(f"Pushing ({config.model})", total, self.output)
        with self._executor() as executor, bar as advance:

            def on_episode(record: "EpisodeRecord") -> None:
                nonlocal solved
                solved += record.solved
                advance(1, f"{solved} solved")

            if shard is not None:
                run_share(
                    config, self.out, shard, executor=executor, on_episode=on_episode
                )
                return []
            return run_trials(
                config, self.out, executor=executor, on_episode=on_episode
            )

    def _executor(self) -> AbstractContextManager[Executor | None]:
        """Return what runs the trials: a physical robot one after another, here."""
        if not self.config.is_physical:
            return self.machines.executor(self.workers)
        for name in ("scheduler", "shard"):
            given = getattr(self.machines, name)
            require(given is None, name, "left out with a physical robot", given)
        return nullcontext()

    def _rehearse(self) -> Json:
        """Show the commands of the first push of every trial."""
        from sainet.control.trials import rehearse_trials

        bar = progress_bar("Rehearsing", self.config.trials, self.output)
        with bar as advance:
            rehearse_trials(self.config, on_trial=lambda trial: advance(1, ""))
        return {"dry_run": True, "trials": self.config.trials}

    def _animate(self, records: list["EpisodeRecord"]) -> None:
        from sainet.report.figures.video import best_format, frame_count, write_film
        from sainet.report.pages.page import Report, write_report

        first = records[0]
        film = self.out / f"episode-000{best_format()}"
        with progress_bar(
            "Drawing", frame_count(first), self.output, waiting=""
        ) as advance:
            write_film(first, film, on_frame=lambda: advance(1, film.name))
        config = self.config
        report = Report(
            title=f"{config.planner.capitalize()} search, {config.goals} goals",
            subtitle=f"{config.model} plans, {_place(config)}",
            episodes=records,
            manifest=read_json(self.out / MANIFEST),
            commands=(command_of("control", config, out=self.out, animate=True),),
        )
        page = write_report(report, self.out / "replay.html")
        self.output.say(f"{film} shows the first episode; {page} plays {len(records)}.")


def _place(config: ControlConfig) -> str:
    """Return where the episodes took place."""
    return {
        "simulated": f"the world is simulated in {config.world}",
        "lab": f"in virtual lab {config.lab} on {config.surface}",
        "abb": "a physical robot pushes",
    }[config.robot]


def _outcome(config: ControlConfig, found: "TrialRow") -> str:
    """Say how many goals were reached, and how soon those that were."""
    low, high = found.interval
    pushes = found.median_pushes
    return (
        f"{config.model}: {found.solved} of {found.trials} {config.goals} goals "
        f"solved (95 % interval {low:.0%} to {high:.0%})"
        + ("." if pushes is None else f", with a median of {pushes:g} pushes.")
    )
