"""Overviews of several studies."""

import msgspec
import pytest
from matplotlib.axes import Axes

from report import samples
from sainet.evaluation.measurements import PublishedValues
from sainet.evaluation.summary import Estimate, Factor
from sainet.evaluation.trials import TrialRow
from sainet.models.identity import ModelId
from sainet.report.figures.overview import (
    Part,
    draw_errors_over_physics,
    draw_success,
)
from sainet.report.palette import style_of


@pytest.fixture
def drawn(monkeypatch):
    """Collect the coordinates of everything that is plotted."""
    found: list[tuple[float, float]] = []
    plot = Axes.plot

    def noted(self, x, y, *rest, **look):
        xs = x if isinstance(x, list) else [x]
        ys = y if isinstance(y, list) else [y]
        found.extend(zip(xs, ys, strict=True))
        return plot(self, x, y, *rest, **look)

    monkeypatch.setattr(Axes, "plot", noted)
    return found


def of_errors():
    factors = (
        ("physics", 4.0, Estimate(1.0, 1.0, 1.0)),
        ("sain", 1.0, Estimate(4.0, 2.0, 5.0)),
    )
    known = tuple(
        PublishedValues(condition="", model=ModelId(kind=kind), values={"pos_mm": e})
        for kind, e in (("physics", (6.0, 4.0)), ("sain", (3.0, 4.0)))
    )
    found = samples.summary([samples.row("physics", 1, 4.0), samples.row("sain", 1, 1)])
    return msgspec.structs.replace(
        found,
        published=known,
        factors=tuple(
            Factor(
                condition="",
                model=model,
                metric="pos_mm",
                error=error,
                baseline=4.0,
                factor=factor,
            )
            for model, error, factor in factors
        ),
    )


def test_errors_are_drawn_over_those_of_physics(tmp_path, drawn):
    summary = of_errors()
    ids = {model.slug: model for model in summary.models}
    known = tuple(
        msgspec.structs.replace(p, model=ids[p.model.kind]) for p in summary.published
    )
    summary = msgspec.structs.replace(summary, published=known)
    paths = [tmp_path / "a.svg", tmp_path / "b.svg"]
    for path in paths:
        draw_errors_over_physics([Part("One", summary), Part("Two", summary)], path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    text = paths[0].read_text()
    assert ">One</text>" in text and ">Two</text>" in text
    assert text.count(f">{style_of('sain').label}</text>") == 2
    assert f">{style_of('physics').label}</text>" not in text  # it is the unit
    shares = {round(x, 6) for x, _ in drawn[:4]}
    assert shares == {0.25, 1 / 5, 0.5, 0.7}  # ours, its interval, the published one


def test_an_interval_without_upper_end_reaches_the_edge(tmp_path, drawn):
    summary = of_errors()
    engine, sain = summary.factors
    sain = msgspec.structs.replace(sain, factor=Estimate(4.0, 2.0))
    summary = msgspec.structs.replace(summary, factors=(engine, sain))
    draw_errors_over_physics([Part("One", summary)], tmp_path / "a.svg")
    assert {x for x, _ in drawn} >= {0.0, 0.25, 0.5}


def test_success_is_drawn_with_its_interval(tmp_path, drawn):
    row = TrialRow(
        condition="easy",
        model="sain",
        trials=20,
        solved=18,
        success=0.9,
        interval=(0.7, 0.97),
        median_pushes=18.0,
        median_decision_s=None,
        within_4_mm=0.5,
        within_25_pushes=0.9,
        median_final_mm=None,
        ended_early=0,
    )
    summary = samples.summary([samples.row("sain", 1, 1.0)])
    summary = msgspec.structs.replace(
        summary, trials=(row, msgspec.structs.replace(row, condition="hard"))
    )
    path = draw_success([Part("Easy goals", summary, "easy")], tmp_path / "a.svg")
    assert drawn == [(0.7, 1.0), (0.97, 1.0), (0.9, 1.0)]
    assert ">published</text>" not in path.read_text()
