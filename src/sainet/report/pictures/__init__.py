"""Pictures that explain the method, drawn by code for the documentation."""

from collections.abc import Callable
from pathlib import Path

from sainet.report.pictures.chart import draw_chart
from sainet.report.pictures.method import draw_method
from sainet.report.pictures.one_push import draw_one_push
from sainet.report.pictures.push_frame import draw_push_frame
from sainet.report.pictures.table_columns import draw_table_columns

PICTURES: dict[str, Callable[[Path], Path]] = {
    "chart": draw_chart,
    "method": draw_method,
    "one-push": draw_one_push,
    "push-frame": draw_push_frame,
    "table-columns": draw_table_columns,
}


def draw_pictures(folder: Path) -> None:
    """Draw every picture into a folder, as SVG."""
    for name, draw in PICTURES.items():
        draw(folder / f"{name}.svg")
