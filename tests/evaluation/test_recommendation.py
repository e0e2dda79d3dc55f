"""Which model a cross-validation recommends, and in which words."""

import pytest

from sainet.engines.simulator import SIMULATORS
from sainet.evaluation.intervals import Estimate
from sainet.evaluation.measurements import Condition
from sainet.evaluation.recommendation import ENDS, recommend
from sainet.evaluation.summary import Comparison, Row, Summary
from sainet.models.identity import ModelId
from sainet.report.recommending import verdict
from sainet.studies.recorded_models import IDENTIFIED

MODELS = (
    ModelId(kind="physics", simulator=SIMULATORS["planar"]),
    ModelId(kind="physics", simulator=IDENTIFIED),
    ModelId(kind="gp", simulator=IDENTIFIED, features="side"),
    ModelId(kind="gp", simulator=IDENTIFIED, features="place"),
)
ORDER = [model.slug for model in MODELS]


def summary_of(*conditions, spread=0.1):
    """Summaries of errors (mm, degrees) of the four models, in each condition."""
    rows, pairs = [], []
    for label, errors in conditions:
        for slug, values in zip(ORDER, errors, strict=True):
            known = dict(zip(ENDS, map(Estimate, values), strict=True))
            rows.append(Row(condition=label, model=slug, body=1, values=known))
        for one, (slug, ours) in enumerate(zip(ORDER, errors, strict=True)):
            for other in range(one):
                for metric, a, b in zip(ENDS, ours, errors[other], strict=True):
                    found = Estimate(a - b, a - b - spread, a - b + spread)
                    pairs.append(
                        Comparison(
                            condition=label,
                            model=slug,
                            against=ORDER[other],
                            body=1,
                            metric=metric,
                            difference=found,
                        )
                    )
    return Summary(
        models=MODELS,
        conditions=tuple(Condition(label=label) for label, _ in conditions),
        rows=tuple(rows),
        comparisons=tuple(pairs),
    )


def chosen(*conditions):
    summary = summary_of(*conditions)
    labels = [label for label, _ in conditions]
    found = recommend(summary, ORDER, labels)
    return found, verdict(found, summary, ORDER, labels)


@pytest.mark.parametrize(
    ("errors", "model", "words"),
    [
        ([(2, 4), (2, 4), (1.95, 4), (2, 4.05)], 0, "Neither identification"),
        ([(2, 4), (1, 3), (0.95, 3), (1, 3.05)], 1, "Identify, do not learn"),
        ([(2, 4), (1, 3), (0.5, 2), (0.45, 2)], 2, "Learning is worth it"),
        ([(2, 4), (1, 3), (0.5, 2), (0.5, 1)], 3, "Learning is worth it"),
        # Less in position and more in rotation is not better.
        ([(2, 4), (1, 3), (0.5, 3.5), (0.4, 4)], 1, "Identify"),
        # A model that errs more is passed over; the next one may still be better.
        ([(2, 4), (1, 3), (1.5, 3), (0.5, 3)], 3, "Learning"),
    ],
)
def test_a_model_replaces_simpler_ones_where_it_is_clearly_better(errors, model, words):
    found, text = chosen(("kind", errors))
    assert found.model == ORDER[model]
    assert text.startswith(words)
    assert text.count("\n") == 0


def test_a_model_must_be_better_in_every_division():
    good = [(2, 4), (1, 3), (0.5, 2), (0.2, 1)]
    bad = [(2, 4), (1, 3), (0.5, 2), (0.8, 1)]  # the last one does not extrapolate
    assert chosen(("kind", good), ("place", good))[0].model == ORDER[3]
    found, text = chosen(("kind", good), ("place", bad))
    assert found.model == ORDER[2]
    assert "By kind: 0.50 mm and 2.00°" in text
    assert "0.50 [0.40, 0.60] mm and 1.00 [0.90, 1.10]° less than" in text


def test_gains_are_over_the_engine_as_it_is_and_over_the_identified_one():
    found, _ = chosen(("kind", [(2, 4), (1, 3), (0.5, 2), (0.5, 2)]))
    gains = {(gain.against, gain.metric): gain for gain in found.gains}
    assert set(gains) == {(slug, metric) for slug in ORDER[:2] for metric in ENDS}
    gain = gains[ORDER[1], "final_pos_mm"]
    assert (gain.error, gain.error_against) == ((0.5,), (1.0,))
    assert gain.difference[0].value == pytest.approx(-0.5)
    assert chosen(("kind", [(1, 1)] * 4))[0].gains[0].against == ORDER[1]
