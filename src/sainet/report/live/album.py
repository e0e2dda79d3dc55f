"""Episodes of the session, kept as records and saved as a run folder."""

from pathlib import Path
from typing import NamedTuple

import msgspec

from sainet.control.config import ControlConfig
from sainet.control.episode import SOLVED, Episode
from sainet.control.record import (
    FOLDER,
    SUMMARY,
    EpisodeRecord,
    Finished,
    episode_file,
    episode_files,
    record,
)
from sainet.control.trial import Trial
from sainet.runs.documents import write_document
from sainet.runs.folders import RunFolder, open_run

CHOSEN = "chosen"  # goals of the user
_ENDED = "ended by the user"


class Take(NamedTuple):
    """An episode, and what its record needs."""

    control: ControlConfig
    goals: str
    trial: Trial
    episode: Episode

    @property
    def record(self) -> EpisodeRecord:
        """The record of the episode so far."""
        found = record(self.control, 0, self.trial, self.episode)
        reason = SOLVED if found.solved else _ENDED
        return msgspec.structs.replace(found, goals=self.goals, reason=reason)


class Album:
    """Records of the episodes with at least one push."""

    def __init__(self, out: Path) -> None:
        """Start empty.

        Args:
            out: run folder to save to; episodes in it are kept.
        """
        self.out = out
        self._records: list[EpisodeRecord] = []
        self._first: int | None = None  # number of the first one in the folder
        self._folder: RunFolder | None = None  # keeps its lock from the first save on

    def __len__(self) -> int:
        """Return the number of finished episodes."""
        return len(self._records)

    def add(self, take: Take) -> None:
        """Keep a finished episode."""
        if take.episode.steps:
            self._records.append(take.record)

    def save(self, current: Take) -> int:
        """Write all episodes, the current one as it is, and return their number.

        Raises:
            RunConflict: the folder belongs to another run, or another page uses it.
            BadInput: the folder cannot be written.
        """
        records = [*self._records, *([current.record] if current.episode.steps else [])]
        if not records:
            return 0
        folder = self._folder = open_run(self.out, {"command": "play"}, finished_by="")
        if self._first is None:
            self._first = len(episode_files(folder.path))
        for number, each in enumerate(records, start=self._first):
            path = episode_file(folder.path, number)
            write_document(path, msgspec.structs.replace(each, trial=number))
        count = self._first + len(records)
        names = [f"{FOLDER}/{number:03d}.json" for number in range(count)]
        write_document(folder.path / SUMMARY, Finished(names))
        return len(records)
