"""Stored pushes in scripts: open, divide, read."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from numbers import Real
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from weakref import finalize

import numpy as np
from jaxtyping import Int, UInt64

from sainet.api.progress import shown_progress
from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate as simulate
from sainet.datasets.splits import split
from sainet.datasets.store import Store, open_store
from sainet.runs.errors import require
from sainet.scenes.quantities import require_count, require_seed


@dataclass(frozen=True)
class Pushes:
    """Recorded or simulated pushes of a dataset, or some of them.

    ``len(pushes)`` is their number. Nothing is read before it is needed.
    """

    store: Store
    # Deleted with the last pushes in it; None: a folder that stays.
    folder: "TemporaryFolder | None" = field(default=None, repr=False, compare=False)

    def __len__(self) -> int:
        """Return the number of pushes."""
        return self.store.info.pushes

    def __repr__(self) -> str:
        """Return number, disks, origin and dataset in one line."""
        info = self.store.info
        kind = "recorded" if info.is_recorded else f"simulated by {info.engine}"
        disks = f"{info.bodies} disk{'s' * (info.bodies > 1)}"
        return f"<{len(self)} pushes of {disks}, {kind}: {self.store.path}>"

    def split(
        self, test: float = 0.2, seed: int = 0, *, chains: bool = False
    ) -> "tuple[Pushes, Pushes]":
        """Return training pushes and test pushes, drawn at random.

        Repeats of a push stay together: a model trained on one repeat was, in effect,
        trained on all.

        Args:
            test: share of the test pushes, above 0 and below 1; met as nearly as
                repeats allow.
            seed: of the draw, 0 or more.
            chains: keep recorded chains together as well: pushes that start where
                another push ended.

        Raises:
            BadSetting: an argument is out of its range.
            BadInput: all pushes are repeats of each other.
        """
        is_number = isinstance(test, Real)
        require(is_number and 0 < test < 1, "test", "above 0 and below 1", test)
        require_seed(seed)
        training, tests = split(self.store, test, seed, chains=chains)
        return replace(self, store=training), replace(self, store=tests)

    def first(self, count: int) -> "Pushes":
        """Return only the first pushes.

        Args:
            count: their number, from 1.

        Raises:
            BadInput: there are fewer.
        """
        return replace(self, store=self.store.first(count))

    def take(self, rows: Iterable[int] | Int[np.ndarray, " row"]) -> "Pushes":
        """Return only the pushes with these indices, in this order.

        Args:
            rows: whole numbers from 0, [row]; not a mask.

        Raises:
            BadInput: there is no push with one of them, or none was chosen.
        """
        return replace(self, store=self.store.take(rows))

    def of_group(self, name: str) -> "Pushes":
        """Return the pushes of one group, or of all groups of one surface.

        Args:
            name: of the group, ``abs-10`` for example, or of the surface, ``abs``.

        Raises:
            BadInput: there is no such group.
        """
        return replace(self, store=self.store.of_group(name))

    @property
    def groups(self) -> tuple[str, ...]:
        """The names of the groups; empty where none were recorded."""
        return self.store.info.groups

    @property
    def hashes(self) -> UInt64[np.ndarray, " push"]:
        """The hash of each push, of its start and its command, equal in any dataset."""
        return self.store.push_hashes()

    def batch(self, steps: int | None = None) -> PushBatch:
        """Return all pushes as arrays with a leading axis, push.

        Args:
            steps: number of steps to keep; None: those of the longest push.

        Returns:
            Its `scene`, `initial` and `controls` are what `Model.predict` takes;
            `truth` [push, time, body, 6] has x, y (m), angle (rad) and their rates,
            NaN where `pose_observed` or `rate_observed` [push, time] is False.
        """
        if steps is not None:
            require_count("steps", steps)
        return to_batch(self.store.read(slice(None)), self.store.info, steps=steps)


class TemporaryFolder:
    """A folder that is deleted with the last reference to it."""

    def __init__(self) -> None:
        """Make the folder."""
        self.path = Path(mkdtemp(prefix="sainet-"))
        finalize(self, rmtree, self.path, ignore_errors=True)


Dataset = Pushes | Store | Path | str


def open_pushes(path: Path | str) -> Pushes:
    """Return the pushes of a dataset after checking that it is whole.

    Args:
        path: folder that `sainet import`, `sainet generate` or `sainet.generate` made,
            `dataset` of `sainet record`, or `train` or `test` of `sainet split`.

    Raises:
        BadStore: the dataset is missing, unfinished, damaged or of another format.
    """
    return Pushes(store_of(path))


def generate(
    config: GenerateConfig,
    out: Path | str | None = None,
    *,
    progress: bool | None = None,
) -> Pushes:
    """Simulate pushes of random scenes; equal settings give equal pushes.

    Args:
        config: number of pushes, disks, engine, noise, seed, ...
        out: run folder; an identical call resumes or opens it. None: a temporary
            folder, deleted with the last pushes in it.
        progress: show a progress bar; None: on a terminal.

    Raises:
        RunConflict: the folder belongs to another run.
        BadInput: a scene has no room for its disks, or an engine cannot have as many.
    """
    is_config = isinstance(config, GenerateConfig)  # pyright: ignore
    require(is_config, "config", "a GenerateConfig", config)
    folder = TemporaryFolder() if out is None else None
    path = folder.path if folder else Path(out or "")
    with shown_progress("Simulating", config.pushes, progress) as advance:
        store = simulate(config, path, on_pushes=lambda count: advance(count, ""))
    return Pushes(store, folder)


def store_of(pushes: Dataset) -> Store:
    """Return the dataset of pushes that are given in any form."""
    if isinstance(pushes, Pushes):
        return pushes.store
    if isinstance(pushes, Store):
        return pushes
    is_path = isinstance(pushes, Path | str)  # pyright: ignore
    require(is_path, "pushes", "a dataset, or its folder", pushes)
    return open_store(pushes)
