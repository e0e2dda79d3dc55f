"""Steps of studies divided among shards, each of which runs those that it can.

A step belongs to one shard. A shard runs its steps whose inputs exist, until those that
remain wait for other shards; run again, it goes on.
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sainet.runs.shards import Shard, Share, collect, open_share
from sainet.studies.durations import Clock
from sainet.studies.runner import Runner, all_steps
from sainet.studies.steps import Step


class Several(Step[None]):
    """Several steps, which run at once where they can."""

    parts: tuple[Step[Any], ...]

    def run(self, runner: Runner) -> None:
        """Return nothing: the results are in the folders of the parts."""


@dataclass(frozen=True)
class Shared:
    """How far the steps of a shard are."""

    done: int
    waiting: int  # for steps of other shards

    def in_words(self, shard: Shard) -> str:
        """Return the outcome in a sentence."""
        if not self.waiting:
            return f"Shard {shard} has finished its {self.done} steps."
        return (
            f"Shard {shard} has finished {self.done} of its {self.done + self.waiting} "
            "steps; the others need steps of other shards: run the shards again, or "
            "the command without a shard."
        )


def kept_steps(lasts: Iterable[Step[Any]]) -> dict[str, Step[Any]]:
    """Return all steps with run folders, as `all_steps` does."""
    every = all_steps(lasts)
    return {key: step for key, step in every.items() if step.is_kept}


def unfinished(steps: Iterable[Step[Any]], out: Path) -> list[Step[Any]]:
    """Return the steps without a finished result among the run folders in `out`."""
    clock, found = Clock(out), []
    for step in steps:
        took = clock.duration(step)
        has_ended = took is not None and took.has_ended and step.is_kept
        if not (has_ended and (out / step.folder_name).is_dir()):
            found.append(step)
    return found


def _nearest_kept(step: Step[Any]) -> Iterator[Step[Any]]:
    """Yield the steps with run folders that a step needs, directly or by way of others.

    What those need in turn is finished with them.
    """
    for each in step.inputs:
        if each.is_kept:
            yield each
        else:
            yield from _nearest_kept(each)


def divided(steps: Mapping[str, Step[Any]], shard: Shard) -> list[Step[Any]]:
    """Return the steps of a shard.

    The steps of a fold need each other in turn: they belong to one shard, which need
    not wait for others.
    """
    index: dict[str, int] = {}
    count = 0
    for key, step in steps.items():
        if step.stays_with_inputs:
            index[key] = index[next(_nearest_kept(step)).key]
        else:
            index[key], count = count, count + 1
    return [step for key, step in steps.items() if shard.takes(index[key])]


def run_share(
    lasts: Iterable[Step[Any]],
    out: Path,
    settings: Mapping[str, object],
    shard: Shard,
    runner: Runner,
) -> Shared:
    """Run the steps of a shard whose inputs exist.

    Args:
        lasts: the steps that are asked for.
        out: folder of the command, which contains those of the runner.
        settings: of the command, equal for all shards.
        shard: whose steps are run.
        runner: of the steps.

    Raises:
        SainetError: whatever a step raises.
        RunConflict: the folder has shards of other settings or versions.
    """
    own = divided(kept_steps(lasts), shard)
    with open_share(out, settings, shard) as share:
        while ready := _ready(own, share):
            runner.result(Several(tuple(ready)))
            share.add(*(step.folder_name for step in ready))
        finished = share.finished()
    done = sum(step.folder_name in finished for step in own)
    return Shared(done, len(own) - done)


def _ready(own: Iterable[Step[Any]], share: Share) -> list[Step[Any]]:
    """Return the steps that can run."""
    finished = share.finished()
    return [
        step
        for step in own
        if step.folder_name not in finished
        and all(each.folder_name in finished for each in _nearest_kept(step))
    ]


@contextmanager
def collected(
    lasts: Iterable[Step[Any]], out: Path, settings: Mapping[str, object]
) -> Iterator[None]:
    """Tell what shards have finished, if any; the body makes what is missing.

    Raises:
        RunConflict: the shards have other settings or versions, or one is at work.
    """
    shards = collect(out, settings)
    if shards is not None:
        names = [step.folder_name for step in kept_steps(lasts).values()]
        shards.tell(sum(name not in shards.pieces for name in names), len(names))
    yield
    if shards is not None:
        shards.clear()
