"""The figure of errors over the number of disks."""

import numpy as np
import pytest
from msgspec import structs

from report.samples import row, summary
from sainet.evaluation.measurements import Condition
from sainet.report.figures.counts import _lines, draw_errors_over_disks

PLACES = {
    "2 disks": (2, "cluster"),
    "3 disks, cluster": (3, "cluster"),
    "3 disks, row": (3, "row"),
}


@pytest.fixture
def found():
    """SAIN errs by 3.6 mm times the number of disks, disk 1 twice as much."""
    rows = [
        row(model, body, scale * disks * (2 if body == 1 else 1), label)
        for model, scale in (("physics", 2), ("sain", 1))
        for label, (disks, _) in PLACES.items()
        for body in range(1, disks + 1)
    ]
    conditions = tuple(
        Condition(label=label, factors={"disks": disks, "arrangement": arrangement})
        for label, (disks, arrangement) in PLACES.items()
    )
    return structs.replace(summary(rows), conditions=conditions)


@pytest.mark.parametrize("arrangement", ["cluster", "row"])
def test_a_line_has_the_mean_of_all_disks_of_each_number(found, arrangement):
    lines = _lines(found, ["physics", "sain"], arrangement, "pos_mm")
    by_hand = [(2, 3.6 * 2 * 3 / 2), (3, 3.6 * 3 * 4 / 3)]
    np.testing.assert_allclose(lines["sain"], by_hand)
    np.testing.assert_allclose(lines["physics"], [(n, 2 * e) for n, e in by_hand])


def test_the_figure_names_models_and_arrangements(found, tmp_path):
    text = draw_errors_over_disks(found, tmp_path / "counts.svg").read_text("utf-8")
    for words in ("Physics", "SAIN", "Clusters", "Rows", "position error (mm)"):
        assert words in text
    again = draw_errors_over_disks(found, tmp_path / "again.svg").read_text("utf-8")
    assert again == text
