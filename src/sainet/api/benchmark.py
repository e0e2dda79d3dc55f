"""A benchmark that others can enter: tracks, a scorer, and entries of results.

A track is a fixed set of test pushes, by the command that makes them, the hash of their
starts and commands, and how far the disks travel; ``tracks.toml`` lists them. A file of
predictions is scored by the errors of every other table; its entry, a small document,
is ranked beside the models of the package.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from jaxtyping import Int
from msgspec import Meta, Struct, structs, to_builtins, toml

from sainet.api.evaluating import evaluate
from sainet.api.predictions import from_predictions
from sainet.api.pushes import Dataset, store_of
from sainet.api.table import ErrorTable
from sainet.datasets.splits import fold_of_push
from sainet.evaluation.intervals import Estimate
from sainet.evaluation.measurements import Condition, Measurements
from sainet.evaluation.summary import BASELINE, Row
from sainet.runs import documents
from sainet.runs.errors import BadInput, shown, unknown_name

_REMEDY = "write it again with `score`"
# mm. Contacts amplify the last bits, in which processors differ: the mean travel then
# changes by 0.0003 mm; with another engine that of some disk by 0.06 mm or more.
_SAME_TRAVEL = 0.003
# They stand in Markdown and HTML.
_Text = Annotated[str, Meta(pattern=r"\A[^\n<>|\[\]`\\]*\Z", max_length=100)]
_Link = Annotated[str, Meta(pattern=r"\A(https?://[^\s<>|()\[\]]+)?\Z", max_length=300)]


class Track(Struct, frozen=True, kw_only=True):
    """Test pushes that everybody predicts, and the errors that count.

    Attributes:
        title: in headings.
        study: whose models are ranked beside entries.
        command: makes the dataset.
        hash: of starts, commands and repeats, by `hash_of`.
        travel_mm: of each disk, mean of the true pushes (mm).
        condition: of the study; empty: its only one.
        beside: conditions of other studies on the same folds.
        position: the error that counts: mean over a push, or at its end (mm).
        rotation: the same (degrees).
        folds: 1 if models may be trained on any pushes but the track's.
    """

    title: str
    study: str
    command: str
    hash: str
    travel_mm: tuple[float, ...]
    condition: str = ""
    beside: dict[str, str] = {}
    position: str = "pos_mm"
    rotation: str = "rot_deg"
    folds: int = 1

    def fold_of_push(self, pushes: Dataset) -> Int[np.ndarray, " push"]:
        """Return the fold of each push, from 0; repeats of a push are in one fold.

        Args:
            pushes: the dataset of the track, or its folder.
        """
        return fold_of_push(store_of(pushes).repeats(), self.folds)

    def joined(self, measured: Measurements, pushes: Dataset) -> Measurements:
        """Return measurements of all pushes together, in folds where there are some."""
        whole = measured.in_condition(Condition())
        if self.folds == 1:
            return whole
        fold = ("sample", self.fold_of_push(pushes).astype(np.int32))
        return replace(whole, data=whole.data.assign_coords(fold=fold))

    def check_travel(self, measured: Measurements, where: Path) -> None:
        """Raise `BadInput` unless the disks travel as far as those of the track."""
        found = measured.data["travel_mm"].values.mean(axis=0)
        if not np.allclose(found, self.travel_mm, rtol=0, atol=_SAME_TRAVEL):  # or NaN
            raise BadInput(
                f"{where}: the disks travel {(*found.round(3).tolist(),)} mm on "
                f"average, not {self.travel_mm}; run '{self.command}'."
            )

    def scored(self, rows: tuple[Row, ...], where: Path) -> tuple[Row, ...]:
        """Return the rows of bodies with the errors that count only.

        Raises:
            BadInput: one of them is missing.
        """
        keys = (self.position, self.rotation)
        kept = [{k: row.values.get(k, Estimate()) for k in keys} for row in rows]
        if not all(each.value is not None for row in kept for each in row.values()):
            raise BadInput(
                f"{where}: {' and '.join(keys)} not known; predict all steps."
            )
        pairs = zip(rows, kept, strict=True)
        return tuple(structs.replace(row, values=values) for row, values in pairs)


class Entry(Struct, frozen=True, kw_only=True):
    """The errors of one file of predictions on one track, as `score` writes them.

    Attributes:
        name: of the model.
        authors: of the model.
        link: to a paper or code; may be empty.
        track: name of the track.
        hash: of the dataset, as in `Track`.
        predictions: SHA-256 of the file.
        errors: of each body, with 95 % intervals (mm, degrees).
        digest: SHA-256 of all other fields.
        format_version: of this document.
    """

    name: Annotated[_Text, Meta(min_length=1)]
    authors: _Text
    link: _Link
    track: str
    hash: str
    predictions: str
    errors: tuple[Row, ...]
    digest: str = ""
    format_version: int = 1

    def digested(self) -> "Entry":
        """Return the entry with the digest of its other fields."""
        plain = to_builtins(structs.replace(self, digest=""))
        found = documents.content_hash(documents.to_json(plain).encode())
        return structs.replace(self, digest=found)


def tracks() -> dict[str, Track]:
    """Return the tracks of the benchmark by name."""
    listed = Path(__file__).with_name("tracks.toml")
    return toml.decode(documents.read_file(listed), type=dict[str, Track])


def track(name: str) -> Track:
    """Return a track of the benchmark.

    Args:
        name: `recorded`, `table-1`, `table-2` or `table-3`.

    Raises:
        UnknownName: no track has this name.
    """
    if name not in tracks():
        raise unknown_name("track", name, tracks())
    return tracks()[name]


def hash_of(pushes: Dataset) -> str:
    """Return the hash of starts, commands and repeats of pushes, in order.

    Unlike the hash of a dataset's files, it depends neither on the processor nor on
    simulator predictions, nor on how arrays are compressed.
    """
    store = store_of(pushes)
    keys = store.push_hashes().astype("<u8"), store.repeats().astype("<i8")
    return documents.content_hash(b"".join(each.tobytes() for each in keys))


def score(
    predictions: Path | str,
    track_name: str,
    data: Dataset,
    *,
    name: str | None = None,
    entry: Path | str | None = None,
    authors: str = "",
    link: str = "",
) -> ErrorTable:
    """Return the errors of a file of predictions on a track, beside physics.

    Args:
        predictions: a .npz or .csv file, as `from_predictions` takes it, of every push.
        track_name: `recorded`, `table-1`, `table-2` or `table-3`.
        data: the dataset of the track, or its folder.
        name: of the model; None: the name of the file.
        entry: .json file to write; those in ``results/entries`` are ranked.
        authors: of the model, for the entry.
        link: to a paper or code, for the entry.

    Raises:
        BadInput: no track has this name, the data are not those of the track, or the
            predictions are incomplete or not finite.
    """
    chosen, store, path = track(track_name), store_of(data), Path(predictions)
    _check_hash(store.path, hash_of(store), chosen.hash, f"run '{chosen.command}'")
    model = from_predictions(path, store, name=name)
    measured = evaluate([BASELINE, model], store).measured
    chosen.check_travel(measured, store.path)
    table = ErrorTable(chosen.joined(measured, store))
    rows = tuple(row for row in table.summary.rows if row.model == model.name)
    made = Entry(
        name=model.name,
        authors=authors,
        link=link,
        track=track_name,
        hash=chosen.hash,
        predictions=documents.content_hash(path.read_bytes()),
        errors=chosen.scored(rows, path),
    )
    if entry is not None:
        documents.write_document(Path(entry), documents.checked(made.digested(), entry))
    return table


def read_entry(path: Path) -> Entry:
    """Return an entry that `score` wrote, after checking that nothing was changed.

    Raises:
        BadInput: it is damaged, was edited, or is of another track or other data.
    """
    entry = documents.read_document(path, Entry, remedy=_REMEDY)
    if entry.digested() != entry or entry.track not in tracks():
        raise BadInput(f"{path}: digest or track was edited; {_REMEDY}.")
    chosen = track(entry.track)
    _check_hash(path, entry.hash, chosen.hash, _REMEDY)
    chosen.scored(entry.errors, path)
    return entry


def _check_hash(path: Path, found: str, wanted: str, remedy: str) -> None:
    if found != wanted:
        raise BadInput(
            f"{path}: hash is {shown(found, 9)}, not {wanted[:9]}; {remedy}."
        )
