"""The learning curve shows a training, not where it was written."""

from sainet.learning.log import LogLine
from sainet.report.figures.curves import draw_history

LOG = [
    LogLine(5, 2.0),
    LogLine(10, 1.0, 1.2),
]


def test_equal_logs_in_other_folders_give_the_same_bytes(tmp_path):
    curves = []
    for name in ("first", "a longer name"):
        (tmp_path / name).mkdir()
        path = draw_history("sain", LOG, tmp_path / name / "learning-curve.svg")
        curves.append(path.read_bytes())
    assert curves[0] == curves[1]
    assert b">SAIN<" in curves[0]
