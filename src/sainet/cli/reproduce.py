"""`sainet reproduce`."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tyro.conf import Positional

from sainet.cli.devices import compile_fast_elsewhere, use_devices
from sainet.cli.help import message
from sainet.cli.output import Bars, Json, Output
from sainet.runs.errors import BadInput, MissingExtra
from sainet.runs.executors import Machines
from sainet.runs.workers import core_count
from sainet.scenes.quantities import require_count
from sainet.studies import Scale

if TYPE_CHECKING:
    from sainet.runs.shards import Shard
    from sainet.studies.runner import Runner
    from sainet.studies.steps import Step
    from sainet.studies.study import Scope, Study


@dataclass(frozen=True, kw_only=True)
class Reproduce:
    """Run studies; finished steps are not repeated."""

    studies: Positional[tuple[str, ...]] = ()
    """Studies: direct-force-two-disks (the paper's Table I), direct-force-three-disks
    (II) and robot-two-disks (III), with Bullet; data-efficiency, recurrent-or-not,
    regularisation, shorter-training and robustness, with the networks of Table III;
    published-physics, letter, letter-millimetres, letter-scaled-loss, letter-noise
    and letter-weak-damper; feedforward, varied-or-fixed and crossed-properties, at
    reduced size; simulated-control, control-any-number, control-in-the-way and
    adaptation, with shipped networks; any-number, any-number-assumed and gaps;
    expected-cost; robot-planar; engine-parity; pretrained (the shipped networks);
    fine-tuning (settings chosen on simulated pushes); recorded-pushes,
    recorded-trust, recorded-chosen, recorded-ensembles, recorded-few, recorded-active
    and lab-realism, which need --recorded; lab-collect, lab-prediction (Table IV),
    lab-control, lab-new-surface, lab-swapped-disks, lab-adaptation and lab-active, in
    virtual labs. Default: every study whose requirements are met."""
    scale: Scale = "quick"
    """Size of datasets and training runs: quick for minutes per study, paper for 4,500
    pushes and 10,000 iterations per network."""
    out: Path = Path("runs/reproduce")
    """Folder to write, with one folder per study and one run folder per step."""
    recorded: Path | None = None
    """Dataset of recorded pushes, from 'sainet import mitpush-endpoints'.
    Default: none."""
    trainings: int | None = None
    """Maximum training runs of each network at the scale paper; with 1 the whole paper
    takes hours instead of a day. Default: up to five, as each study needs."""
    at_once: int | None = None
    """Number of steps that run at the same time, each in a process on one core and with
    about 1 GB; with 1, steps run one after another on all devices. Default: one per
    core, 1 on a GPU."""
    devices: int | None = None
    """Number of CPU devices that share a batch. Default: one per core."""
    machines: Machines = field(default_factory=Machines)
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Run the studies one after another, or the steps of a shard."""
        use_devices(self.devices)
        if self.scale == "quick":
            compile_fast_elsewhere()
        at_once = self._steps_at_once()
        shard = self.machines.share
        from sainet.studies import STUDIES, load_study
        from sainet.studies.shares import collected, run_share
        from sainet.studies.study import MissingInput, Scope, last_steps

        if self.trainings is not None:
            require_count("trainings", self.trainings)
        scope = Scope(self.scale, self.recorded, self.trainings)
        studies = {name: load_study(name) for name in self.studies or STUDIES}
        not_run: dict[str, str] = {}
        for name, study in studies.items():
            try:
                study.check(scope)
            except (MissingExtra, MissingInput) as error:
                if self.studies:
                    raise
                not_run[name] = message(error, type(self))
                self.output.warn(f"{name} is not run: {not_run[name]}")
        studies = {name: s for name, s in studies.items() if name not in not_run}
        steps = list(last_steps(study.plan(scope) for study in studies.values()))
        settings = self._settings(scope, studies)
        expected = self._expected(steps, shard)
        with self._runner(at_once, steps, expected) as runner:
            if shard is not None:
                done = run_share(steps, self.out, settings, shard, runner)
                self.output.say(done.in_words(shard))
                return {"shard": str(shard), **asdict(done)}
            with collected(steps, self.out, settings):
                tables = {
                    name: self._answer(name, study, scope, runner)
                    for name, study in studies.items()
                }
            self._report(steps, not_run, runner)
        if len(tables) == 1 and not not_run:
            return next(iter(tables.values()))
        return {"studies": tables, "not_run": not_run}

    def _expected(
        self, lasts: Sequence["Step[Any]"], shard: "Shard | None"
    ) -> Mapping[str, float]:
        """Return the seconds that each unfinished step should take, and print a sum."""
        from sainet.studies.durations import in_words
        from sainet.studies.effort import expected_seconds
        from sainet.studies.runner import all_steps
        from sainet.studies.shares import divided, kept_steps, unfinished
        from sainet.studies.study import STEPS

        steps = list(all_steps(lasts).values())
        if shard is not None:
            steps = divided(kept_steps(lasts), shard)
        left = unfinished(steps, self.out / STEPS)
        expected = expected_seconds(left)
        self.output.say(
            f"{len(left)} of {len(steps)} steps are left: "
            f"{in_words(sum(expected.values()))} on {core_count()} cores."
        )
        return expected

    def _report(
        self, lasts: Sequence["Step[Any]"], not_run: Mapping[str, str], runner: "Runner"
    ) -> None:
        """Write the report of all studies in the folder."""
        from sainet.report.pages.page import REPORT, write_report
        from sainet.studies.runner import all_steps
        from sainet.studies.whole_report import whole_report

        steps = all_steps(lasts).values()
        command = shlex.join(self._command(*self.studies, out=self.out))
        report = whole_report(
            self.out, self.scale, not_run, steps, runner.clock, command=command
        )
        path = write_report(report, self.out / REPORT)
        self.output.say(f"All studies in {self.out} on one page: {path}")

    def _command(self, *studies: str, out: Path | None = None) -> list[str]:
        """Return the command that makes the results of studies, word by word."""
        words = ["sainet", "reproduce", *studies, "--scale", self.scale]
        given = {"out": out, "recorded": self.recorded, "trainings": self.trainings}
        for name, value in given.items():
            words += [] if value is None else [f"--{name}", str(value)]
        return words

    @contextmanager
    def _runner(
        self, at_once: int, steps: Sequence["Step[Any]"], expected: Mapping[str, float]
    ) -> Iterator["Runner"]:
        """Yield the runner of the steps, which runs several at once."""
        from sainet.engines.devices import is_one_gpu
        from sainet.studies.durations import Clock
        from sainet.studies.on_gpu import train_alike
        from sainet.studies.runner import MANY, Runner
        from sainet.studies.study import STEPS

        folder, machines = self.out / STEPS, self.machines
        clock = Clock(folder, expected)
        workers = None if at_once == 1 else at_once
        with (
            machines.executor(workers, core_each=at_once > 1) as pool,
            Bars(self.output) as bars,
        ):
            if machines.scheduler is not None:
                yield Runner(folder, pool, bars, MANY, steps, clock)
            elif at_once == 1:
                together = train_alike if is_one_gpu() else None
                yield Runner(
                    folder, pool, bars, ahead=steps, clock=clock, together=together
                )
            else:  # while this process makes a table, the next step begins
                yield Runner(folder, pool, bars, at_once + 1, steps, clock)

    def _settings(
        self, scope: "Scope", studies: Mapping[str, "Study"]
    ) -> dict[str, object]:
        """Return what all shards of a run have in common."""
        pushes = self.recorded and scope.recorded_pushes().content
        made = {"command": "reproduce", "scale": self.scale, "recorded": pushes}
        return {**made, "trainings": self.trainings, "studies": list(studies)}

    def _answer(
        self, name: str, study: "Study", scope: "Scope", runner: "Runner"
    ) -> Json:
        """Run a study, print its table and its claims; return its JSON object."""
        from sainet.report.arrange import arrange
        from sainet.report.verdicts import rulings
        from sainet.report.writers import print_table

        self.output.say(f"{name}: {study.question}")
        out = self.out / f"{name}-{self.scale}"
        result = study.run(name, scope, runner, out, command=self._command(name))
        console = self.output.console
        print_table(arrange(result.summary), console)
        for ruling in rulings(study.claims, result.summary):
            console.print(ruling, markup=False, soft_wrap=True)
        return result.to_json()

    def _steps_at_once(self) -> int:
        """Return the number of steps to run at once.

        Raises:
            BadInput: fewer than one is wanted, or several on one GPU.
        """
        import jax

        is_cpu = jax.default_backend() == "cpu"
        usual = core_count() if is_cpu else 1
        count = usual if self.at_once is None else self.at_once
        if count < 1:
            raise BadInput(f"--at-once is {count}; it must be at least 1.")
        if count > 1 and not is_cpu:
            raise BadInput(f"--at-once is {count}; on a GPU it must be 1.")
        return count
