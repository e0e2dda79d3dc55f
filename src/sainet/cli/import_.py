"""`sainet import`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from sainet.cli.devices import use_cache
from sainet.cli.output import Json, Output
from sainet.runs.errors import BadInput

if TYPE_CHECKING:
    from sainet.datasets.store import Store


@dataclass(frozen=True, kw_only=True)
class Import:
    """Convert recorded pushes to a dataset."""

    format: Positional[Literal["mitpush-endpoints", "mitpush", "table"]]
    """mitpush-endpoints: poses before and after pushes of the MIT Push dataset.
    mitpush: raw MIT Push dataset, poses during each push of its disk.
    table: own pushes, one row for each push, time and body."""
    path: Annotated[Positional[Path], arg(metavar="PATH")]
    """mitpush-endpoints: the CSV, its folder, or a .mat log of the authors.
    mitpush: a zip, a folder tree of zips, or a folder of .h5 or .json files.
    table: a .csv or .parquet file."""
    out: Path
    """Run folder; identical settings resume."""
    properties: Path | None = None
    """TOML file of masses, radii and frictions (only for the format table)."""
    contact_friction: float | None = None
    """Friction between pusher and disk, and between disks.
    None: value of the properties of a table, else 0.25,
    from a sweep on pushes of the MIT Push dataset."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Import the pushes."""
        use_cache()
        store = self._import()
        self.output.say(f"{store.info.pushes} pushes are in {self.out}")
        groups = list(store.info.groups)
        return {"out": str(self.out), "pushes": store.info.pushes, "groups": groups}

    def _import(self) -> "Store":
        friction = self.contact_friction
        if self.format == "table":
            from sainet.datasets.recorded.own import import_table

            if self.properties is None:
                raise BadInput("`properties` is missing; give a TOML file of bodies.")
            return import_table(
                self.path, self.properties, self.out, contact_friction=friction
            )
        if self.properties is not None:
            raise BadInput("`properties` is for the format table; leave it out.")
        given = {} if friction is None else {"contact_friction": friction}
        if self.format == "mitpush":
            from sainet.datasets.recorded.raw import import_mitpush

            return import_mitpush(self.path, self.out, **given)
        from sainet.datasets.recorded.endpoints import import_endpoints

        return import_endpoints(self.path, self.out, **given)
