"""`sainet import`."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional, arg

from sainet.cli.output import Output


@dataclass(frozen=True, kw_only=True)
class Import:
    """Read recorded pushes into a dataset."""

    format: Positional[Literal["mitpush-endpoints"]]
    """mitpush-endpoints: start and end of pushes of the MIT Push dataset."""
    path: Annotated[Positional[Path], arg(metavar="PATH")]
    """The CSV, the folder that holds it, or a .mat log of the authors."""
    out: Path
    """Run folder to write."""
    contact_friction: float = 0.25
    """Friction between pusher and disk; the default is from a sweep on such pushes."""
    output: Output = field(default_factory=Output)

    def run(self) -> dict[str, Any]:
        """Import the pushes."""
        from sainet.datasets.mitpush import import_endpoints

        store = import_endpoints(
            self.path, self.out, contact_friction=self.contact_friction
        )
        self.output.say(f"{store.info.pushes} pushes are in {self.out}")
        groups = list(store.info.groups)
        return {"out": str(self.out), "pushes": store.info.pushes, "groups": groups}
