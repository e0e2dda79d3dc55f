"""Runs the steps of studies in order, each once, and reports their progress."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from graphlib import TopologicalSorter
from pathlib import Path
from typing import Any, TypeVar, cast

from sainet.learning.log import read_log
from sainet.runs.workers import each_done, worker_lost
from sainet.studies.durations import Clock
from sainet.studies.steps import Apart, Step, Train

_LOOK_AGAIN = 1.0  # s
T = TypeVar("T")


@dataclass(frozen=True)
class Progress:
    """An event: how much of a step is done."""

    title: str
    done: int
    total: int
    note: str = ""
    has_ended: bool = False  # no further event of this step
    left: float = 0.0  # s, that all unfinished steps are expected to take


Report = Callable[[Progress], None]


@dataclass
class Bar:
    """Counts what is done of one step, and reports it."""

    title: str
    total: int
    report: Report
    clock: Clock
    done: int = 0
    note: str = ""

    def add(self, amount: int, note: str = "") -> None:
        """Report so much more."""
        self.reach(self.done + amount, note)

    def reach(self, done: int, note: str = "") -> None:
        """Report that so much is done in all."""
        self.done, self.note = done, note
        left = self.clock.remaining(done / self.total if self.total else 0.0)
        self.report(Progress(self.title, done, self.total, note, left=left))


@dataclass
class Runner:
    """Runs steps in the order of their inputs; finished ones are not repeated."""

    out: Path  # of all run folders
    executor: Executor | None = None  # simulates and runs episodes; None: this process
    report: Report = lambda event: None  # noqa: E731
    trainers: Executor | None = None  # trains networks at once; None: one by one
    expected: Mapping[str, float] = field(default_factory=dict)  # s, by keys of steps
    _results: dict[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Keep the durations of steps beside their run folders."""
        self.clock = Clock(self.out, self.expected)

    def folder(self, step: Step[Any]) -> Path:
        """Return the run folder of a step."""
        return self.out / step.folder_name

    def result(self, step: Step[T]) -> T:
        """Return the result of a step, which is run first if it was not.

        Raises:
            SainetError: whatever the step raises.
        """
        if step.key not in self._results:
            self._run(step)
        return cast("T", self._results[step.key])

    @contextmanager
    def bar(self, title: str, total: int) -> Iterator[Bar]:
        """Report the beginning and the end of some work, and what is between."""
        bar = Bar(title, total, self.report, self.clock)
        bar.reach(0)
        yield bar
        self.report(Progress(title, total, total, bar.note, has_ended=True))

    def _run(self, last: Step[Any]) -> None:
        """Run a step after all that it needs, directly or not."""
        steps: dict[str, Step[Any]] = {last.key: last}
        order: TopologicalSorter[str] = TopologicalSorter()
        for step in (waiting := [last]):
            needed = [each for each in step.inputs if each.key not in self._results]
            order.add(step.key, *(each.key for each in needed))
            waiting += [each for each in needed if each.key not in steps]
            steps |= {each.key: each for each in needed}
        order.prepare()
        while order.is_active():
            ready = order.get_ready()
            self._train([s for k in ready if isinstance(s := steps[k], Train)])
            self._work([s for k in ready if isinstance(s := steps[k], Apart)])
            for key in ready:
                with self.clock.time([steps[key]], are_done=True):
                    self._results[key] = steps[key].run(self)
            order.done(*ready)

    def _work(self, steps: Sequence[Apart[Any]]) -> None:
        """Do the work of several steps at once."""
        if self.executor is None or steps == steps[:1]:
            return
        jobs = [(step, self.folder(step), index) for index, step in enumerate(steps)]
        title = f"{steps[0].name} and {len(steps) - 1} more"
        with self._timed(steps), self.bar(title, len(steps)) as bar:
            for _ in each_done(self.executor, _work_at, jobs):
                bar.add(1)

    def _train(self, steps: Sequence[Train]) -> None:
        """Train several networks at once; finished ones and a single one need no pool.

        A batch that is split over cores waits for the slowest of them at every
        iteration. Networks that do not depend on each other never wait.

        Raises:
            SainetError: what `fit` raises, of the first that fails; or a process was
                ended from outside.
        """
        left = [step for step in steps if not step.is_finished(self)]
        if self.trainers is None or left == left[:1]:
            return
        total = sum(step.iterations for step in left)
        futures: dict[Future[Any], Train] = {}
        try:
            title = f"Training {len(left)} networks"
            with self._timed(left), self.bar(title, total) as bar:
                for step in left:
                    futures[self.trainers.submit(step.fitting(self))] = step
                waiting = set(futures)
                while waiting:
                    done, waiting = wait(waiting, _LOOK_AGAIN, FIRST_COMPLETED)
                    for future in done:
                        future.result()
                    bar.reach(*self._look(futures))
        except BrokenProcessPool:
            raise worker_lost() from None
        finally:
            for future in futures:
                future.cancel()

    def _timed(self, steps: Sequence[Step[Any]]) -> AbstractContextManager[None]:
        """Time work that others do; `run` ends the steps."""
        return self.clock.time(steps, are_done=False)

    def _look(self, futures: dict[Future[Any], Train]) -> tuple[int, str]:
        """Return the iterations so far, and the losses of those under way."""
        total, losses = 0, []
        for future, step in futures.items():
            if future.done():
                total += step.iterations
            elif lines := read_log(self.folder(step)):
                total += lines[-1].iteration
                losses.append(f"{lines[-1].loss:.3g}")
        return total, f"losses {', '.join(losses)}" if losses else ""


def _work_at(step: Apart[Any], folder: Path, index: int) -> int:
    """Do the work of a step (the job of a worker) and return its index."""
    step.work(folder)
    return index
