"""`sainet cross-validate`."""

import shlex
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from sainet.cli.devices import use_devices
from sainet.cli.output import Bars, Json, Output
from sainet.datasets import Scheme
from sainet.report import WRITERS
from sainet.runs.errors import require, require_one_of
from sainet.runs.executors import Machines
from sainet.studies import USUAL_CANDIDATES, CandidateName

if TYPE_CHECKING:
    from sainet.models.identity import ModelId


@dataclass(frozen=True, kw_only=True)
class CrossValidate:
    """Find out on your pushes whether identification or learning is worth it.

    Each push is predicted by models that were fitted without it. The verdict names the
    model to use: each model, from the simplest, replaces the one before if it errs
    clearly less in every division into folds.
    """

    data: Path
    """Dataset of recorded pushes, all at one table; with several surfaces as groups,
    each has models of its own."""
    out: Path = Path("runs/cross-validation")
    """Folder to write: the fitted models of all folds, measurements and a page. An
    identical call resumes; other settings use the models that are there."""
    by: tuple[Scheme, ...] = ("chain",)
    """Divisions into folds. kind: repeats of a push stay together. chain: also pushes
    that start where another one ended. place, direction, side (of the disk) and order
    (of recording): test pushes lie in a part that training pushes left out."""
    folds: int = 5
    """Number of folds."""
    models: tuple[CandidateName, ...] = USUAL_CANDIDATES
    """Learned models beside the engine as it is and the identified engine: Gaussian
    processes (gp) and networks (sain). side: for pushes of one disk only. place: also
    at one place of one table."""
    group: str | None = None
    """Group of pushes to use (default: all groups)."""
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
        from sainet.studies.cross_validation import candidates_named, cross_validated
        from sainet.studies.runner import MANY, Runner
        from sainet.studies.shares import collected, run_share
        from sainet.studies.study import STEPS
        from sainet.studies.validation import cross_validate

        store = open_part(self.data, self.group, self.pushes)
        models = candidates_named(self.models)
        parts, _ = cross_validated(store, self.by, self.folds, models)
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
            self.output.say(sentence)
        print_table(found.table, self.output.console)
        self.output.say(f"\nNext: {self._command(found.recommended)}\nPage: {page}")
        if self.table is not None:
            write_table(found.table, self.table)
        return {**found.to_json(), "page": str(page)}

    def _command(self, model: "ModelId") -> str:
        """Return the command that makes the recommended model of all pushes."""
        group = ["--group", self.group] if self.group is not None else []
        data = shlex.join(["--data", str(self.data), *group])
        if model.kind == "physics":
            is_identified = model.simulator and model.simulator.is_identified
            name = "identify" if is_identified else "evaluate --model physics"
            out = " --out runs/identified" if is_identified else ""
            return f"sainet {name} {data}{out}"
        given = f"--features {model.features} {data}"
        if model.kind == "gp":
            return f"sainet tune gp {given} --out runs/model"
        return (
            f"sainet identify {data} --out runs/identified && sainet tune sain {given} "
            "--engine runs/identified --out runs/model"
        )
