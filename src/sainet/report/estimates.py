"""What was identified, as a table for a terminal."""

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from sainet.models.card import Identified

_HEADINGS = ("parameter", "before", "value", "95 % interval")


def print_estimates(found: Identified, console: Console) -> None:
    """Print each estimate, parameters that are not identifiable, and the errors.

    Args:
        found: what was identified.
        console: to print on.
    """
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for index, heading in enumerate(_HEADINGS):
        table.add_column(heading, justify="right" if index else "left")
    for estimate in found.estimates:
        told = not estimate.doubt
        interval = f"{estimate.low:.3g} to {estimate.high:.3g}"
        cells = (
            estimate.name.replace("_", " "),
            f"{estimate.start:.3g}",
            f"{estimate.value:.3g}" if told else "kept",
            interval if told else "–",
        )
        table.add_row(*map(Text, cells))
    console.print(table)
    for estimate in found.estimates:
        if estimate.doubt:
            name = estimate.name.replace("_", " ")
            console.print(Text(f"{name} is not identifiable: {estimate.doubt}."))
    console.print(
        Text(
            f"Mean errors where {found.pushes} pushes were observed: position "
            f"{found.before_mm:.2f} mm before, {found.after_mm:.2f} mm after; "
            f"rotation {found.before_deg:.2f} and {found.after_deg:.2f} degrees."
        )
    )
