"""The same numbers from all five writers, and no markup from names."""

import csv
import io
import re
from html.parser import HTMLParser

import msgspec
import pytest
from rich.console import Console

from report import samples
from report import test_verdicts as verdicts
from sainet.evaluation.lab_outcomes import TrialOutcome
from sainet.evaluation.measurements import Condition
from sainet.evaluation.summary import Estimate, Summary
from sainet.models.identity import ModelId
from sainet.report import WRITERS
from sainet.report.arrange import arrange
from sainet.report.writers import (
    print_table,
    to_csv,
    to_html,
    to_latex,
    to_markdown,
    write_table,
)

HOSTILE = "<script>alert(1)</script>|[red]*x*"
NOTHING = Summary(models=())


def printed(summary, width=120):
    stream = io.StringIO()
    print_table(arrange(summary), Console(file=stream, width=width, color_system=None))
    return stream.getvalue()


def markdown(summary):
    return to_markdown(arrange(summary))


class Cells(HTMLParser):
    """Collects the text of each table cell, row by row."""

    def __init__(self):
        super().__init__()
        self.rows, self.inside, self.tags = [], False, set()

    def handle_starttag(self, tag, _):
        self.tags.add(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag == "small":
            self.rows[-1][-1] += " "
        self.inside = tag != "p"

    def handle_data(self, data):
        if self.inside and self.rows and self.rows[-1]:
            self.rows[-1][-1] += data.strip()


def parse(summary):
    cells = Cells()
    cells.feed(to_html(arrange(summary)))
    return cells


def test_html_has_every_number_in_its_cell():
    row = parse(samples.result()).rows[2]
    assert row[:4] == ["Physics", "500", "1.44 1.35–1.54", "1.30 1.22–1.39"]
    assert row[-2:] == ["34.0 32.0–36.4", "30.6 28.8–32.7"]


def test_markdown_rows_all_have_the_same_columns():
    text = markdown(samples.result())
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert {len(re.split(r"(?<!\\)\|", row)) for row in rows} == {10}
    assert "| 3.60 / 3.24<br><sub>3.38–3.85 / 3.05–3.47</sub> |" in rows[2]
    assert "**0.59** / **0.53**" in rows[5]
    assert rows[6].startswith("| *Physics, published* |")
    assert "*6.27* / *5.81*" in rows[6]
    assert "SAIN minus IN: pos −0.162" in text


def test_terminal_shows_columns_by_disk_or_pairs_when_narrow():
    wide, narrow = (printed(samples.result(), width) for width in (120, 80))
    assert "3.38–3.85" in wide
    assert re.search(r"Physics +500 .* 3\.60 +3\.24", wide)
    assert "3.38–3.85" not in narrow
    assert re.search(r"Physics +500 .* 3\.60/3\.24", narrow)
    assert max(map(len, narrow.splitlines())) <= 80
    assert "…" not in narrow


def test_every_writer_prints_the_same_numbers():
    table = arrange(samples.result())
    values = [cell.text for line in table.lines for cell in line.cells]
    (_, *rows) = csv.reader(io.StringIO(to_csv(table)))
    assert [value for row in rows[:4] for value in row[2::2]] == values
    latex = re.sub(r"\\textbf{(.*?)}", r"\1", to_latex(table)).splitlines()
    found = [line.removesuffix(r" \\").split(" & ")[2:] for line in latex[4:8]]
    assert [value for line in found for value in line] == values


def test_the_best_of_each_condition_is_marked():
    rows = [
        samples.row(model, 1, scale, group)
        for group, scales in (("abs-10", (1.0, 0.5)), ("plywood-10", (0.4, 0.8)))
        for model, scale in zip(("physics", "sain"), scales, strict=True)
    ]
    lines = markdown(samples.summary(rows)).splitlines()
    assert [("**" in line) for line in lines[2:6]] == [False, True, True, False]
    assert lines[2].startswith("| abs-10 | Physics |")


def test_a_missing_number_is_a_dash():
    (first, *rest) = samples.result().rows
    missing = samples.row(first.model, 1, 1.0, pos_mm=None)
    result = msgspec.structs.replace(samples.result(), rows=(missing, *rest))
    assert parse(result).rows[2][4] == "–"
    assert "| – / 3.24" in markdown(result)
    assert "nan" not in printed(result)
    (heading, *rows) = csv.reader(io.StringIO(to_csv(arrange(result))))
    assert rows[0][heading.index("pos (mm) disk 1")] == ""  # a number for programs


def test_metrics_without_numbers_are_left_out():
    lacking = dict.fromkeys(samples.row("physics", 1, 1.0).values)
    kept = samples.row("physics", 1, 1.0).values["final_pos_mm"]
    row = samples.row("physics", 1, 1.0, **lacking | {"final_pos_mm": kept})
    result = samples.summary([row])
    assert markdown(result).splitlines()[0] == "| Model | n | final pos (mm) |"
    assert "trans" not in printed(result)


def test_where_only_ends_are_known_nothing_is_repeated():
    def row(model, scale):
        ends = samples.row(model, 1, scale).values
        same = {"pos_mm": ends["final_pos_mm"], "rot_deg": ends["final_rot_deg"]}
        return samples.row(model, 1, scale, **same)

    pairs = [
        samples.compared("sain", "physics", -1.0, metric)
        for metric in ("pos_mm", "final_pos_mm")
    ]
    rows = [row("physics", 1.0), row("sain", 0.5)]
    result = samples.summary(rows, comparisons=tuple(pairs))
    heading = markdown(result).splitlines()[0]
    assert heading.split(" | ")[2:4] == ["final pos (mm)", "final rot (deg)"]
    assert "trans" not in printed(result)
    assert printed(result).count("−1.000") == 1
    alone = samples.summary(rows, comparisons=tuple(pairs[1:]))  # still reported
    assert printed(alone).count("−1.000") == 1


def test_physics_is_compared_with_unless_true_properties_are():
    pairs = {
        against: samples.compared("sain", against, -1.0)
        for against in ("physics", "physics-true", "in")
    }
    rows = [samples.row(name, 1, 0.5) for name in ("physics", "in", "sain")]
    few = samples.summary(rows, comparisons=(pairs["physics"], pairs["in"]))
    assert "SAIN minus Physics: pos" in printed(few)
    true = samples.row("physics-true", 1, 0.4)
    beside = printed(samples.summary([*rows, true], comparisons=tuple(pairs.values())))
    assert "SAIN minus Physics, true properties: pos" in beside
    assert "SAIN minus Physics: pos" not in beside


def test_true_properties_that_change_nothing_are_said_once():
    rows = [samples.row(name, 1, 0.5) for name in ("physics", "physics-true", "sain")]
    pairs = tuple(samples.compared("sain", a) for a in ("physics", "physics-true"))
    text = markdown(samples.summary(rows, comparisons=pairs))
    assert "| Physics, true properties |" not in text
    assert text.count("Physics, true properties") == 1
    assert "do not change these predictions" in text
    assert "SAIN minus Physics: pos" in text


def test_a_table_ends_in_a_verdict():
    text = printed(samples.result(), width=200)
    assert text.rstrip().splitlines()[-1] == (
        "SAIN errs by 0.59 mm in position on average, the engine by 3.60 mm, 6.1 "
        "times as much [5.5, 6.7]; "
        "the network without an engine errs by 0.76 mm, the engine with true masses "
        "and radii by 0.83 mm."
    )


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (3.5, "no clear difference (ratio 1.03 [0.93, 1.13])"),
        (7.2, "the engine by 3.60 mm: this model 2.0 times as much [1.82, 2.2]."),
        (1.8, "the engine by 3.60 mm, 2.0 times as much [1.80, 2.2]."),
        # Beyond a factor of ten the difference says more.
        (40.0, "the engine by 3.60 mm: this model 36.40 mm more [36.30, 36.50]."),
        (0.3, "the engine by 3.60 mm, 3.30 mm more [3.20, 3.40]."),
    ],
)
def test_a_verdict_counts_only_what_is_clear(error, words):
    rows = [samples.row(name, 1, 1.0) for name in ("physics", "sain")]
    factors = samples.factor("physics", 3.6), samples.factor("sain", error)
    assert words in printed(samples.summary(rows, factors=factors), width=200)


@pytest.mark.parametrize(
    ("low", "words"),
    [
        (0.8, "no clear difference (ratio 2.0 [0.80, –])"),  # noqa: RUF001
        (1.2, "2.0 times as much [1.20, –]"),  # noqa: RUF001
    ],
)
def test_an_unknown_upper_end_is_a_dash(low, words):
    rows = [samples.row(name, 1, 1.0) for name in ("physics", "sain")]
    ratio = Estimate(2.0, low)
    open_ended = msgspec.structs.replace(samples.factor("sain", 1.8), factor=ratio)
    factors = samples.factor("physics", 3.6), open_ended
    assert words in printed(samples.summary(rows, factors=factors), width=200)


def test_nothing_at_all_is_said_in_words():
    for text in (to_html(arrange(NOTHING)), markdown(NOTHING), printed(NOTHING)):
        assert "Nothing to show" in text


def test_hostile_names_stay_text():
    result = samples.result()
    result = msgspec.structs.replace(
        result,
        rows=(*result.rows, samples.row(HOSTILE, 1, 0.3, group=HOSTILE)),
        models=(*result.models, samples.identity(HOSTILE)),
        conditions=(*result.conditions, Condition(label=HOSTILE)),
    )
    cells = parse(result)
    assert "script" not in cells.tags
    assert "alert(1)" in str(cells.rows)
    text = markdown(result)
    assert "<script" not in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len({len(re.split(r"(?<!\\)\|", row)) for row in rows}) == 1
    assert "[red]" in printed(result, 200)


def test_names_mean_nothing_to_latex():
    name = r"[a^b~c] \d{e} <f>|g_h"
    model = ModelId(kind="physics", name=name)
    row = samples.row(model.slug, 1, 0.3)
    result = msgspec.structs.replace(samples.summary([row]), models=(model,))
    (line,) = [e for e in to_latex(arrange(result)).splitlines() if "g\\_h" in e]
    assert line.startswith(
        r"{[}a\textasciicircum{}b\textasciitilde{}c] \textbackslash{}d\{e\} "
        r"\textless{}f\textgreater{}\textbar{}g\_h & "
    )


@pytest.mark.parametrize("ending", WRITERS)
def test_a_table_is_written_in_the_format_of_its_file(tmp_path, ending):
    path = tmp_path / f"table{ending}"
    write_table(arrange(samples.result()), path)
    text = path.read_text()
    assert "SAIN" in text
    parts = {".md": "| :--", ".html": "<table", ".tex": r"\begin{tabular}"}
    assert parts.get(ending, "Model,n,") in text


def test_trials_fit_a_terminal_and_outcomes_in_labs_have_columns():
    conditions = ("easy", "hard, swapped disks, properties in order")
    outcome = {
        "within_2_mm": Estimate(0.4, 0.2, 0.6),
        "overshoot_mm": Estimate(7.1, -3.7, 22.0),
        "stuck": Estimate(0.06, -0.04, 0.17),
    }
    of_trials = verdicts.summary([], conditions, ("sain",))
    labs = msgspec.structs.replace(
        of_trials,
        outcomes=tuple(
            TrialOutcome(condition=each, model="sain", values=outcome)
            for each in conditions
        ),
    )
    text = printed(labs, width=80)
    assert max(map(len, text.splitlines())) <= 80 and "…" not in text
    for words in ("within 25 pushes", "7/50", "overshoot (mm)", "6%"):
        assert words in text
    assert "0.0–22.0" in markdown(labs) and "0%–17%" in markdown(labs)
    assert text.count("easy") == 3  # three columns at a time, each with its lines
    assert "stuck" not in printed(of_trials, width=80)
