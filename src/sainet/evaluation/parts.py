"""Errors of each model in a file, so that models can be measured one at a time."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from sainet.datasets.store import Store
from sainet.evaluation.metrics import Errors
from sainet.models.checkpoint import read_arrays, write_arrays
from sainet.models.model import Model
from sainet.runs.documents import content_hash
from sainet.runs.folders import RunFolder, open_run
from sainet.runs.shards import Collected, Shard, Share, collect, open_share


@dataclass(frozen=True)
class Parts:
    """The errors of several models on the same pushes, in one run folder."""

    out: Path
    settings: dict[str, object]
    folder: RunFolder  # keeps its lock

    @classmethod
    def open(
        cls,
        out: Path,
        models: list[Model],
        store: Store,
        settings: Mapping[str, object],
        *,
        shared: bool = False,
    ) -> "Parts":
        """Return the parts in a run folder.

        Args:
            out: the folder.
            models: all models, of which each is a part.
            store: the pushes.
            settings: further settings that errors depend on, as JSON values.
            shared: whether shards may work in the folder meanwhile.

        Raises:
            RunConflict: the folder belongs to another run, or is used by one.
        """
        weights = [[model.name, model.digest] for model in models]
        known: dict[str, object] = {"command": "evaluate", "models": weights}
        known |= {"data": store.content, **settings}
        return cls(out, known, open_run(out, known, finished_by="", shared=shared))

    def file(self, model: str) -> Path:
        """Return the file of the errors of a model."""
        return self.out / f"errors-{content_hash(model.encode())[:12]}.safetensors"

    def errors(self, model: str, measure: Callable[[], Errors]) -> Errors:
        """Return the errors of a model, measured unless they are there.

        Raises:
            BadInput: the file is damaged or was edited.
        """
        path = self.file(model)
        if not path.is_file():
            write_arrays(path, measure())
        return read_arrays(path)

    def share(self, shard: Shard) -> AbstractContextManager[Share]:
        """Return the share of a shard: see `open_share`."""
        return open_share(self.out, self.settings, shard)

    def collect(self, models: list[Model]) -> Collected | None:
        """Return what shards have measured, if any did: see `sainet.runs.shards`."""
        shards = collect(self.out, self.settings)
        if shards is not None:
            missing = sum(not self.file(model.name).is_file() for model in models)
            shards.tell(missing, len(models))
        return shards
