"""`sainet cross-validate`."""

import shlex
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from sainet.cli.devices import use_devices
from sainet.cli.output import Bars, Json, Output
from sainet.datasets import Scheme
from sainet.report import WRITERS
from sainet.runs.errors import require, require_one_of
from sainet.runs.executors import Machines
from sainet.studies import MEMBERS, USUAL_CANDIDATES, CandidateName

if TYPE_CHECKING:
    from sainet.models.identity import ModelId


@dataclass(frozen=True, kw_only=True)
class CrossValidate:
    """Find out from your pushes whether identification or learning is worth it.

    Each push is predicted by models that were fitted without it.

    The verdict names the simplest model that no other model clearly improves on.
    """

    data: Path
    """Dataset of recorded pushes, all on one table. If its groups are of several
    surfaces, each surface has models of its own."""
    out: Path = Path("runs/cross-validation")
    """Folder to write: the fitted models of all folds, measurements and a page. An
    identical call resumes; a call with other settings uses the existing models."""
    by: tuple[Scheme, ...] = ("chain",)
    """Divisions into folds. kind: repeats of a push stay together, if the dataset
    states which pushes these are (column kind of a table). chain: so do pushes
    that start where another push ended. place, direction, side (of the disk) and order
    (of recording): test pushes lie in a part that training pushes leave out."""
    folds: int = 5
    """Number of folds."""
    models: tuple[CandidateName, ...] = USUAL_CANDIDATES
    """Learned models to compare with the engine as it is and the identified engine:
    Gaussian processes (gp; of one or two disks) and networks (sain). side: if all
    pushes are of the same disk. place: if they are also on the same part of one table.
    chosen: the kernel, and the inputs up to these, are chosen in each fold (side takes
    six times as long, place nine). ensemble: the mean of five networks, with 90 %
    regions."""
    group: str | None = None
    """Group of the pushes, or their surface (default: all groups)."""
    pushes: int | None = None
    """Pushes to use, from the start of the dataset (default: all)."""
    table: Path | None = None
    """File for the table: .md, .html, .tex or .csv (default: none)."""
    machines: Machines = field(default_factory=Machines)
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Fit and test every model in every fold, and print the verdict."""
        if self.table is not None:
            require_one_of("table", self.table.suffix, WRITERS)
        require(self.folds > 1, "folds", "at least 2", self.folds)
        use_devices()
        from sainet.datasets.store import open_part
        from sainet.report.writers import print_table, write_table
        from sainet.studies.candidates import candidates_named
        from sainet.studies.cross_validation import cross_validated
        from sainet.studies.recorded_models import surfaces_of
        from sainet.studies.runner import MANY, Runner
        from sainet.studies.shares import collected, run_share
        from sainet.studies.study import STEPS
        from sainet.studies.validation import cross_validate

        store = open_part(self.data, self.group, self.pushes)
        models = candidates_named(self.models)
        parts = cross_validated(store, self.by, self.folds, models).parts
        given = {"by": self.by, "folds": self.folds, "models": self.models}
        settings = {"command": "cross-validate", "data": store.content, **given}
        shard = self.machines.share
        executor = self.machines.executor(core_each=True)
        with executor as pool, Bars(self.output) as bars:
            runner = Runner(self.out / STEPS, pool, bars, MANY)
            if shard is not None:
                done = run_share(parts, self.out, settings, shard, runner)
                self.output.say(done.in_words(shard))
                return {"shard": str(shard), **asdict(done)}
            with collected(parts, self.out, settings):
                found = cross_validate(store, self.by, self.folds, models, runner)
        page = found.write(self.out, self.data)
        for sentence in found.coverage:
            self.output.console.print(sentence, markup=False, soft_wrap=True)
        print_table(found.table, self.output.console)
        counts = {name: len(rows) for name, rows in surfaces_of(store).items()}
        following = self._commands(found.recommended, counts)
        self.output.say("\nNext: " + "\n      ".join(following) + f"\nPage: {page}")
        if self.table is not None:
            write_table(found.table, self.table)
        return {**found.to_json(), "page": str(page), "next": following}

    def _commands(self, model: "ModelId", counts: Mapping[str, int]) -> list[str]:
        """Return the commands that make the recommended model of each surface.

        Args:
            model: the recommended one.
            counts: number of pushes on each surface.
        """
        simulator = model.simulator
        data = f"--data {shlex.quote(str(self.data))}"
        if model.kind == "physics" and not (simulator and simulator.is_identified):
            return [f"sainet evaluate --model physics {_part(data, self.group, None)}"]
        if self.group or len(counts) == 1:
            return [_command(model, _part(data, self.group, self.pushes), "")]
        parts = {
            name: _part(data, name, self.pushes and count)
            for name, count in counts.items()
        }
        return [_command(model, part, f"-{name}") for name, part in parts.items()]


def _part(data: str, group: str | None, pushes: int | None) -> str:
    """Return the options that choose some pushes."""
    data += f" --group {shlex.quote(group)}" if group else ""
    return data + (f" --pushes {pushes}" if pushes else "")


def _command(model: "ModelId", data: str, ending: str) -> str:
    """Return the command that makes a model of all pushes that options choose."""
    ending = "".join(c if c.isalnum() else "-" for c in ending)  # of folders
    engine = f"runs/identified{ending}"
    identify = f"sainet identify {data} --out {engine}"
    if model.kind == "physics":
        return identify
    tune = f"--features {model.features} {data} --out runs/model{ending}"
    if model.kind == "gp":
        return f"sainet tune gp {tune}" + " --choose" * (model.variant == "chosen")
    tune += f" --members {MEMBERS}" * (model.variant == "ensemble")
    return f"{identify} && sainet tune sain {tune} --engine {engine}"
