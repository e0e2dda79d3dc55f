"""`sainet report`."""

from dataclasses import dataclass, field
from pathlib import Path

from tyro.conf import Positional

from sainet.cli.output import Json, Output


@dataclass(frozen=True, kw_only=True)
class MakeReport:
    """Write report.html, a self-contained page, into a run folder."""

    folder: Positional[Path]
    """Run folder of train, tune, identify, control, play, demo or one study of
    reproduce."""
    output: Output = field(default_factory=Output)

    def run(self) -> Json:
        """Write the report, unless the command that made the folder wrote its own."""
        from sainet.report.pages.page import REPORT
        from sainet.runs.documents import write_bytes
        from sainet.studies.run_report import is_of_demo, page_of

        path = self.folder / REPORT
        if not is_of_demo(self.folder):
            write_bytes(path, page_of(self.folder).encode(errors="replace"))
        self.output.say(f"Open {path} in a browser.")
        return {"report": str(path)}
