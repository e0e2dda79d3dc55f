"""The figure of data efficiency."""

from xml.etree import ElementTree

import msgspec

from report import samples
from sainet.evaluation.measurements import Condition
from sainet.evaluation.summary import Estimate
from sainet.report.figures.curves import draw_data_efficiency
from sainet.report.palette import style_of


def table(bodies=(1, 2)):
    errors = {"physics": (4, 4, 4), "in": (6, 1.5, 0.7), "sain": (2, 1, 0.6)}
    sizes = (50, 500, 4500)
    rows = [
        samples.row(
            model,
            body,
            1.0,
            group=f"with {pushes}",
            pos_mm=Estimate(error * body, 0.8 * error * body, 1.2 * error * body),
            rot_deg=Estimate(error / 2, 0.4 * error, 0.6 * error),
        )
        for model, values in errors.items()
        for error, pushes in zip(values, sizes, strict=True)
        for body in bodies
    ]
    conditions = [
        Condition(label=f"with {pushes}", factors={"training_pushes": pushes})
        for pushes in sizes
    ]
    other = Condition(
        label="other seeds", factors={"training_pushes": 99, "seeds": "other"}
    )
    rows += [samples.row("in", body, 5.0, group="other seeds") for body in bodies]
    return msgspec.structs.replace(
        samples.summary(rows), conditions=(*conditions, other)
    )


def test_the_figure_has_every_model_and_is_reproducible(tmp_path):
    one, two = (draw_data_efficiency(table(), tmp_path / f"{n}.svg") for n in "ab")
    assert one.read_bytes() == two.read_bytes()
    assert ElementTree.parse(one).getroot().tag.endswith("svg")
    text = one.read_text()
    for name in ("physics", "in", "sain"):
        assert style_of(name).color in text
        assert f">{style_of(name).label}</text>" in text
    for pushes in ("50", "500", "4,500"):
        assert f">{pushes}</text>" in text
    assert ">99</text>" not in text  # it differs in more than the number of pushes


def test_only_trained_models_have_a_band(tmp_path):
    text = draw_data_efficiency(table(), tmp_path / "a.svg").read_text()
    assert text.count('id="FillBetweenPolyCollection') == 2 * 2 * 2


def test_one_disk_has_a_panel_of_each_error(tmp_path):
    text = draw_data_efficiency(table(bodies=(1,)), tmp_path / "a.svg").read_text()
    assert text.count(">Disk 1</text>") == 2
    for heading in ("position error (mm)", "rotation error (deg)"):
        assert text.count(f">mean {heading}</text>") == 1


def test_where_only_ends_are_known_the_figure_says_so(tmp_path):
    whole = table(bodies=(1,))
    rows = [
        msgspec.structs.replace(
            row,
            values={f"final_{k}": row.values[k] for k in ("pos_mm", "rot_deg")},
        )
        for row in whole.rows
    ]
    ends = msgspec.structs.replace(whole, rows=tuple(rows))
    text = draw_data_efficiency(ends, tmp_path / "a.svg").read_text()
    assert text.count(">mean final position error (mm)</text>") == 1
    assert text.count(">mean final rotation error (deg)</text>") == 1
