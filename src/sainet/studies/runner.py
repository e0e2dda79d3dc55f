"""Runs the steps of studies in order, each once, and reports their progress."""

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast

from sainet.learning.log import read_log
from sainet.runs.errors import SainetError
from sainet.runs.programs import make_room
from sainet.runs.workers import worker_lost
from sainet.studies.durations import Clock
from sainet.studies.steps import Place, Step, Train

MANY = 1_000_000  # steps at once: all that can run
_LOOK_AGAIN = 1.0  # s
T = TypeVar("T")


def all_steps(
    lasts: Iterable[Step[Any]], *, known: Container[str] = ()
) -> dict[str, Step[Any]]:
    """Return steps and all that they need, by their keys: inputs first.

    The order depends only on the steps, so that all shards count them alike.

    Args:
        lasts: steps.
        known: keys of steps that are left out, with what only they need.
    """
    found: dict[str, Step[Any]] = {}
    for step in lasts:
        _add(step, found, known)
    return found


def _add(step: Step[Any], found: dict[str, Step[Any]], known: Container[str]) -> None:
    if step.key in found or step.key in known:
        return
    for each in step.inputs:
        _add(each, found, known)
    found[step.key] = step


@dataclass(frozen=True)
class Progress:
    """An event: how much of some work is done."""

    title: str
    done: int
    total: int
    note: str = ""
    has_ended: bool = False  # no further event of this work
    left: float = 0.0  # s, that all unfinished steps are expected to take


Report = Callable[[Progress], None]


@dataclass
class Bar:
    """Counts what is done of some work, and reports it."""

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
        left = self.clock.remaining()
        self.report(Progress(self.title, done, self.total, note, left=left))


@dataclass
class Runner:
    """Runs steps after their inputs; finished ones are not repeated.

    Other processes run several steps at once: first those that are needed for the
    result that was asked for, then those of `ahead`.
    """

    out: Path  # of all run folders
    executor: Executor | None = None  # None: everything runs in this process
    report: Report = lambda event: None  # noqa: E731
    at_once: int = 0  # steps that the executor has at most; 0: steps run here
    ahead: Sequence[Step[Any]] = ()  # of which results will be asked for, in this order
    clock: Clock = field(default_factory=Clock)
    # Trains, beside a network, those of further steps that are like it.
    together: "Callable[[Train, Iterable[Step[Any]], Runner], None] | None" = None
    _results: dict[str, object] = field(default_factory=dict)
    _errors: dict[str, SainetError] = field(default_factory=dict)
    _running: dict[Future[Any], Step[Any]] = field(default_factory=dict)

    def folder(self, step: Step[Any]) -> Path:
        """Return the run folder of a step."""
        return self.out / step.folder_name

    def result(self, step: Step[T]) -> T:
        """Return the result of a step, which is run first if it was not.

        Raises:
            SainetError: whatever a step raises; or a process was ended from outside.
        """
        try:
            if self.executor is None or not self.at_once:
                for each in self._unknown(step):
                    self._run_here(each)
            elif step.key not in self._results:
                self._run_at_once(step, self.executor)
        except BrokenProcessPool:
            raise worker_lost() from None
        finally:
            if step.key not in self._results:
                self._give_up()
        return cast("T", self._results[step.key])

    @contextmanager
    def bar(self, title: str, total: int) -> Iterator[Bar]:
        """Report the beginning and the end of some work, and what is between."""
        bar = Bar(title, total, self.report, self.clock)
        bar.reach(0)
        yield bar
        self.report(Progress(title, total, total, bar.note, has_ended=True))

    def _unknown(self, *lasts: Step[Any]) -> list[Step[Any]]:
        """Return steps and all that they need, inputs first, without known results."""
        return list(all_steps(lasts, known=self._results).values())

    def _run_here(self, step: Step[Any]) -> None:
        with self.clock.time(step):
            if self.together is not None and isinstance(step, Train):
                self.together(step, self._unknown(step, *self.ahead), self)
            self._results[step.key] = step.run(self)
        make_room()

    def _run_at_once(self, last: Step[Any], executor: Executor) -> None:
        """Run a step after all that it needs, and steps ahead beside them."""
        needed, every = self._unknown(last), self._unknown(last, *self.ahead)
        start = partial(self._start, every, executor)
        while last.key not in self._results:
            start()
            if spread := self._spread_ready(needed):
                self._run_here(spread[0])
            elif last.key not in self._results:
                self._wait(needed, start)

    def _spread_ready(self, steps: Sequence[Step[Any]]) -> list[Step[Any]]:
        """Return those of steps that can run now, over all processes."""
        return [s for s in steps if s.place is Place.SPREAD and self._can_run(s)]

    def _can_run(self, step: Step[Any]) -> bool:
        """Return whether a step has not ended yet, but all its inputs have."""
        if step.key in self._results or step.key in self._errors:
            return False
        return all(each.key in self._results for each in step.inputs)

    def _start(self, steps: Sequence[Step[Any]], executor: Executor) -> None:
        """Give steps to the executor, as many as it takes; run light ones here."""
        begun = {step.key for step in self._running.values()}
        for step in steps:
            if step.key in begun or not self._can_run(step):
                continue
            if step.place is Place.HERE:
                self._run_here(step)
            elif step.place is Place.APART and len(self._running) < self.at_once:
                self._running[executor.submit(run_alone, step, self.out)] = step
                self.clock.begin(step)

    def _wait(self, needed: Sequence[Step[Any]], start: Callable[[], None]) -> None:
        """Wait until nothing needed is running, or all processes are needed for one."""
        apart = [s for s in needed if s.place is Place.APART]
        left = [s for s in apart if s.key not in self._results]
        more = f" and {len(left) - 1} more" if left[1:] else ""
        with self.bar(left[0].name + more, len(left)) as bar:
            while bar.done < len(left) and not self._spread_ready(needed):
                done, _ = wait(self._running, _LOOK_AGAIN, FIRST_COMPLETED)
                for future in done:
                    self._take(future)
                start()
                for step in left:
                    if step.key in self._errors:  # those of steps ahead may wait
                        raise self._errors[step.key]
                ended = sum(step.key in self._results for step in left)
                bar.reach(ended, ", ".join(map(self._progress, self._running.values())))

    def _take(self, future: Future[Any]) -> None:
        """Take the result of a step from the executor, or from its run folder."""
        step, error = self._running.pop(future), future.exception()
        self.clock.end(step, is_done=error is None)
        if isinstance(error, SainetError):
            self._errors[step.key] = error
        elif error is None and step.is_kept:  # and finished, which needs no bar
            Runner(self.out, _results=self._results).result(step)
        else:
            self._results[step.key] = future.result()

    def _progress(self, step: Step[Any]) -> str:
        """Return the name of a step that is running, and how far a network is."""
        lines = read_log(self.folder(step)) if isinstance(step, Train) else ()
        return f"{step.name} at {lines[-1].iteration:,}" if lines else step.name

    def _give_up(self) -> None:
        """Cancel what has not begun; what has begun resumes."""
        for future, step in self._running.items():
            future.cancel()
            self.clock.end(step, is_done=False)
        self._running.clear()


def run_alone(step: Step[T], out: Path) -> T | None:
    """Run a step whose inputs are finished; the job of another process.

    Returns:
        The result, unless it is kept in the run folder.
    """
    found = Runner(out).result(step)
    return None if step.is_kept else found
