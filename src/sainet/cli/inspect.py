"""`sainet inspect`."""

import shlex
from dataclasses import dataclass, field
from pathlib import Path

from tyro.conf import Positional

from sainet.cli.output import Json, Output
from sainet.runs.errors import require

_MOST_LINES = 20  # doubts on the terminal


@dataclass(frozen=True, kw_only=True)
class Inspect:
    """Summarise a dataset of pushes and name its doubtful recordings."""

    data: Positional[Path]
    """Dataset: the folder of import, generate or add-bystander, the folder dataset of
    record, or the folder train or test of split."""
    out: Path | None = None
    """Page to write: summary, pictures and doubtful recordings in one .html file.
    Default: none."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Inspect the dataset, print the summary and write the page."""
        if self.out is not None:
            wanted = "a file that ends in .html"
            require(self.out.suffix.lower() == ".html", "out", wanted, self.out)
        from msgspec import to_builtins

        from sainet.datasets.facts import facts_of
        from sainet.datasets.inspection import inspect
        from sainet.datasets.store import open_store
        from sainet.report.pages.inspection import (
            range_cells,
            sentences_of,
            write_inspection,
        )

        store = open_store(self.data)
        facts = facts_of(store)
        found = inspect(store, facts)
        lines = [*sentences_of(found), ""]
        cells = [("", "least", "median", "largest"), *map(range_cells, found.ranges)]
        lines += [f"{c[0]:<32}{c[1]:>10}{c[2]:>10}{c[3]:>10}" for c in cells]
        listed = found.doubts[:_MOST_LINES]
        lines += [f"row {each.row}: {each.reason}: {each.text}." for each in listed]
        more = len(found.doubts) - len(listed)
        lines += [f"and {more} more doubts; a page or --json lists them."] * (more > 0)
        self.output.console.print("\n".join(lines), markup=False, soft_wrap=True)
        if self.out is not None:
            words = ("sainet", "inspect", str(self.data), "--out", str(self.out))
            command = shlex.join(words)
            write_inspection(store, facts, found, self.out, command=command)
            self.output.say(f"Open {self.out} in a browser.")
        return to_builtins(found) | {"page": str(self.out) if self.out else None}
