"""`sainet import`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional, arg

from sainet.cli.devices import use_cache
from sainet.cli.output import Output
from sainet.runs.errors import BadInput

if TYPE_CHECKING:
    from sainet.datasets.store import Store


@dataclass(frozen=True, kw_only=True)
class Import:
    """Read recorded pushes into a dataset."""

    format: Positional[Literal["mitpush-endpoints", "mitpush", "table"]]
    """mitpush-endpoints: start and end of pushes of the MIT Push dataset.
    mitpush: the raw MIT Push dataset, all along each push of its disk.
    table: your own pushes, one row for each push, time and body."""
    path: Annotated[Positional[Path], arg(metavar="PATH")]
    """mitpush-endpoints: the CSV, its folder, or a .mat log of the authors.
    mitpush: a zip, a folder tree of zips, or a folder of .h5 or .json.
    table: a .csv or .parquet file."""
    out: Path
    """Run folder to write."""
    properties: Path | None = None
    """Masses, radii and frictions as TOML (table alone needs it)."""
    contact_friction: float | None = None
    """Friction between pusher and disk, and between disks.
    None takes what the properties of a table say, else 0.25,
    which is from a sweep on pushes of the MIT Push dataset."""
    output: Output = field(default_factory=Output)

    def run(self) -> dict[str, Any]:
        """Import the pushes."""
        use_cache()
        store = self._import()
        self.output.say(f"{store.info.pushes} pushes are in {self.out}")
        groups = list(store.info.groups)
        return {"out": str(self.out), "pushes": store.info.pushes, "groups": groups}

    def _import(self) -> "Store":
        friction = self.contact_friction
        if self.format == "table":
            from sainet.datasets.recorded.table.importer import import_table

            if self.properties is None:
                raise BadInput("--properties is missing; give a TOML file of bodies.")
            return import_table(
                self.path, self.properties, self.out, contact_friction=friction
            )
        if self.properties is not None:
            raise BadInput("--properties is for the format table; leave it out.")
        given = {} if friction is None else {"contact_friction": friction}
        if self.format == "mitpush":
            from sainet.datasets.recorded.mitpush.raw import import_mitpush

            return import_mitpush(self.path, self.out, **given)
        from sainet.datasets.recorded.mitpush.endpoints import import_endpoints

        return import_endpoints(self.path, self.out, **given)
