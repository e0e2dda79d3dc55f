"""`sainet propose`."""

from dataclasses import dataclass, field
from pathlib import Path

from tyro.conf import Positional

from sainet.cli.devices import use_cache
from sainet.cli.output import Json, Output
from sainet.runs.errors import require


@dataclass(frozen=True, kw_only=True)
class Propose:
    """Propose the next pushes to record for a Gaussian process.

    Each push most reduces the variance left after the pushes proposed before it.
    """

    model: Positional[Path]
    """Folder of the Gaussian process ('sainet tune gp')."""
    count: int = 10
    """Number of pushes to propose."""
    pool: Path | None = None
    """Dataset of possible pushes (default: for one disk, pushes drawn from the whole
    range of the training pushes)."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Choose the pushes and print them."""
        require(self.count > 0, "count", "at least 1", self.count)
        use_cache()
        from msgspec import to_builtins
        from rich import box
        from rich.table import Table

        from sainet.learning.choosing import propose

        proposals = propose(self.model, self.count, self.pool)
        found: list[dict[str, float]] = to_builtins(proposals)
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
        for heading in found[0]:
            table.add_column(heading.replace("_", " "), justify="right")
        for row in found:
            table.add_row(*(f"{value:g}" for value in row.values()))
        self.output.console.print(table)
        return {"pushes": found}
