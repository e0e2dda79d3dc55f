"""Evidence: what `results/` keeps of studies, identifications and benchmarks."""

import lzma
from collections import defaultdict
from pathlib import Path

import msgspec

from sainet.control.record import FOLDER, EpisodeRecord, read_record
from sainet.evaluation.measurements import Measurements, read_measurements
from sainet.evaluation.summary import Summary, summarise
from sainet.models.card import IDENTIFIED, Identified, read_identified
from sainet.models.library import MODELS
from sainet.runs import documents
from sainet.runs.errors import BadInput
from sainet.runs.folders import CONFIG
from sainet.runs.manifest import MANIFEST, Manifest, manifest
from sainet.studies import STUDIES, load_study
from sainet.studies.study import AS_TRAINED, ENGINE_ERRORS, MEASUREMENTS

RESULTS, FIGURES = "results", "docs/figures"
_IDENTIFIED = "identified"  # folder of documents
_EPISODES = "episodes"  # folder of folders, each of one goal


class Benchmark(msgspec.Struct, frozen=True):
    """The figures of a benchmark case, and where they were taken."""

    figures: dict[str, float | str | None]
    machine: str
    note: str = ""
    transcribed: bool = False  # by hand


class Identification(msgspec.Struct, frozen=True):
    """Parameters identified on a group of pushes, and where."""

    found: Identified
    manifest: Manifest


class Evidence:
    """The summaries of studies, and other documents, in the folder ``results``."""

    def __init__(self, root: Path) -> None:
        """Look for evidence in the folder ``results`` of a repository."""
        self.folder = root / RESULTS
        self._summaries: dict[str, Summary] = {}

    def summary(self, name: str) -> Summary:
        """Return the summary of the measurements of a study, or of others."""
        if name not in self._summaries:
            summary = load_study(name).summarise if name in STUDIES else summarise
            self._summaries[name] = summary(self.measured(name))
        return self._summaries[name]

    def find(self, name: str) -> Summary | None:
        """Return the summary of a study, or None if no evidence of it is kept."""
        is_kept = (self.folder / f"{name}.nc.xz").is_file()
        return self.summary(name) if is_kept else None

    def measured(self, name: str) -> Measurements:
        """Return the measurements of a study."""
        return read_measurements(self.folder / f"{name}.nc.xz")

    def benchmark(self, case: str) -> Benchmark:
        """Return the figures of a benchmark case."""
        return documents.read_document(self.folder / f"bench-{case}.json", Benchmark)

    def identifications(self) -> dict[str, Identification]:
        """Return the parameters identified on each group of recorded pushes."""
        paths = sorted((self.folder / _IDENTIFIED).glob("*.json"))
        return {
            path.stem: documents.read_document(path, Identification) for path in paths
        }

    def episodes(self) -> dict[str, list[EpisodeRecord]]:
        """Return the kept episodes of each goal, in the order of `MODELS`."""
        found: dict[str, list[EpisodeRecord]] = defaultdict(list)
        for path in sorted((self.folder / _EPISODES).glob("*/*.json.xz")):
            try:
                text = lzma.decompress(documents.read_file(path))
                record = msgspec.json.decode(text, type=EpisodeRecord)
            except (lzma.LZMAError, EOFError, msgspec.MsgspecError) as error:
                raise BadInput(f"{path}: no episode ({error}); keep it anew.") from None
            found[path.parent.name].append(record)
        return {
            k: sorted(v, key=lambda e: MODELS.index(e.model)) for k, v in found.items()
        }


def described(machine: Manifest) -> str:
    """Return processor, cores and versions in words."""
    known = ", ".join(f"{k} {v}" for k, v in machine.versions.items() if v)
    gpu = f", {machine.gpu}" if machine.gpu else ""
    return f"{machine.processor}, {machine.cores} cores{gpu}; {known}"


def keep(path: Path, root: Path) -> None:
    """Keep evidence in ``results/``: measurements at published precision.

    Args:
        path: the folder of a study or of an identification, the JSON of `sainet
            bench`, made on this machine, or the record of an episode with a model of
            `MODELS`.
        root: the repository.

    Raises:
        BadInput: there is nothing to keep.
    """
    results = root / RESULTS
    if path.is_file() and path.parent.name == FOLDER:
        record = read_record(path)
        if record.model not in MODELS:
            raise BadInput(f"{path}: model is {record.model}, not one of {MODELS}.")
        goal = f"{record.goals}-{len(record.radius_mm)}-disks"
        file = results / _EPISODES / goal / f"{record.model}.json.xz"
        documents.write_bytes(file, lzma.compress(msgspec.json.encode(record)))
        return
    if path.is_file():
        for case, figures in _cases(path).items():
            documents.write_document(results / f"bench-{case}.json", figures)
        return
    if (path / IDENTIFIED).is_file():
        made = documents.read_document(path / MANIFEST, Manifest)
        found = Identification(read_identified(path), made)
        documents.write_document(results / _IDENTIFIED / f"{path.name}.json", found)
        return
    study = documents.read_json(path / CONFIG).get("study", path.name)
    for file, name in ((MEASUREMENTS, f"{study}"), (AS_TRAINED, f"{study}-as-trained")):
        if file == MEASUREMENTS or (path / file).is_file():
            measured = read_measurements(path / file)
            measured.compact().write(results / f"{name}.nc.xz")
    if (path / ENGINE_ERRORS).is_file():
        figure = (path / ENGINE_ERRORS).read_bytes()
        documents.write_bytes(root / FIGURES / f"{study}-{ENGINE_ERRORS}", figure)


def _cases(path: Path) -> dict[str, Benchmark]:
    """Return the cases in the JSON of `sainet bench`, the last line of its output.

    Raises:
        BadInput: the file does not contain figures by case.
    """
    try:
        *_, last = documents.read_file(path).splitlines()
        found = msgspec.json.decode(last, type=dict[str, dict[str, float | str | None]])
    except (ValueError, msgspec.MsgspecError) as error:
        raise BadInput(
            f"{path}: no figures by case ({error}); give the JSON of several cases of "
            "'sainet bench'."
        ) from None
    machine = f"{described(manifest())}."
    return {case: Benchmark(figures, machine) for case, figures in found.items()}
