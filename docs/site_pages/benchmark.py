"""Text of the page of the benchmark: command, hash and ranking of each track."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from sainet.api.benchmark import Track, read_entry, tracks
from sainet.evaluation.intervals import Estimate
from sainet.evaluation.summary import Row, Summary
from sainet.studies.evidence import RESULTS, Evidence

ENTRIES = "entries"  # folder in results/


@dataclass(frozen=True)
class Standing:
    """A model on a track: its rows, one for each body."""

    label: str
    origin: str  # Markdown
    rows: tuple[Row, ...]

    def mean(self, metric: str) -> float:
        """Return the mean of an error over the bodies."""
        values = [row.values[metric].value for row in self.rows]
        known = [value for value in values if value is not None]
        return sum(known) / len(known)

    def cells(self, metric: str) -> Iterator[str]:
        """Yield the error of each body with its interval."""
        return (_cell(row.values[metric]) for row in self.rows)


@cache
def evidence_of(root: Path) -> Evidence:
    """Return the evidence of a repository, whose summaries are made once."""
    return Evidence(root)


def rankings(root: Path) -> str:
    """Return the ranking of every track, from what is in results/.

    Args:
        root: the repository.
    """
    evidence, found = evidence_of(root), entries(root)
    parts = []
    for name, track in tracks().items():
        ours: dict[str, Standing] = {}
        for study, condition in {track.study: track.condition, **track.beside}.items():
            origin = f"[study](results/{study}.md)"
            for each in standings(evidence.summary(study), condition, origin):
                ours.setdefault(each.label, each)
        parts.append(
            f"## Track `{name}`\n\n{track.title}, of the hash `{track.hash[:12]}`:\n\n"
            f"    {track.command}\n\n{ranking([*ours.values(), *found[name]], track)}\n"
        )
    return "\n".join(parts)


def entries(root: Path) -> dict[str, list[Standing]]:
    """Return the checked entries in results/ by track."""
    found: dict[str, list[Standing]] = {name: [] for name in tracks()}
    for path in sorted((root / RESULTS / ENTRIES).glob("*.json")):
        entry = read_entry(path)
        authors = entry.authors or "entry"
        origin = f"[{authors}]({entry.link})" if entry.link else authors
        found[entry.track].append(Standing(entry.name, origin, entry.errors))
    return found


def standings(summary: Summary, condition: str, origin: str) -> list[Standing]:
    """Return the models that a study measured in a condition."""
    rows: dict[str, list[Row]] = {}
    for row in (*summary.rows, *summary.predictions):
        if row.condition == condition:
            rows.setdefault(row.model, []).append(row)
    models = {model.slug: model for model in summary.models}
    return [
        Standing(
            models[slug].label,
            "published" if models[slug].kind == "published" else origin,
            tuple(of_model),
        )
        for slug, of_model in rows.items()
    ]


def ranking(models: Iterable[Standing], track: Track) -> str:
    """Return models as a table, by their errors of position; the least error first."""
    ordered = sorted(models, key=lambda each: each.mean(track.position))
    places = zip(
        *(ranks([each.mean(key) for each in ordered]) for key in _metrics(track)),
        strict=True,
    )
    bodies = len(ordered[0].rows)
    disks = (
        [f"disk {body}" for body in range(1, bodies + 1)] if bodies > 1 else ["disk"]
    )
    head = ["rank, position", "rank, rotation", "model", "from"]
    head += [f"position (mm), {disk}" for disk in disks]
    head += [f"rotation (deg), {disk}" for disk in disks]
    lines = [head, [":--"] * 4 + ["--:"] * (2 * bodies)]
    for place, each in zip(places, ordered, strict=True):
        errors = [cell for key in _metrics(track) for cell in each.cells(key)]
        lines.append([*map(str, place), each.label, each.origin, *errors])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def ranks(values: Sequence[float]) -> list[int]:
    """Return the rank of each value, from 1 for the least; equal values share it."""
    return [1 + sum(other < value for other in values) for value in values]


def _metrics(track: Track) -> tuple[str, str]:
    return track.position, track.rotation


def _cell(found: Estimate) -> str:
    if found.value is None:
        return ""
    if found.low is None or found.high is None:
        return f"{found.value:.2f}"
    return f"{found.value:.2f}<br><sub>{found.low:.2f}–{found.high:.2f}</sub>"  # noqa: RUF001
