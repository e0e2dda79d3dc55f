"""The page of an evaluation: verdict, errors, and pushes that play."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from sainet.datasets.store import Store
from sainet.evaluation.coverage import coverage_of, in_words
from sainet.evaluation.evaluate import steps_to_predict
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.summary import summarise
from sainet.models.model import Model
from sainet.report.figures.paths import draw_error_over_time
from sainet.report.pages.page import Report, write_report
from sainet.report.palette import labels_of, styles_of
from sainet.report.replays import build_replay, error_curves
from sainet.runs.documents import read_json
from sainet.runs.folders import CONFIG

_MOST_AVERAGED = 500  # pushes in the curves of errors over time


class Shown(NamedTuple):
    """A push on the page, and why it is there."""

    push: int  # index in the dataset
    title: str


def write_evaluation(
    models: Sequence[Model],
    store: Store,
    measured: Measurements,
    path: Path,
    *,
    steps: int | None = None,
    command: str,
) -> Path:
    """Write the page of an evaluation atomically and return its path.

    Args:
        models: that were evaluated.
        store: the pushes.
        measured: their errors.
        path: of the page.
        steps: that were predicted, as `evaluate` takes them.
        command: that evaluated them.

    Raises:
        BadInput: the page cannot be written.
    """
    count = steps_to_predict(store, steps)
    replays = [
        build_replay(models, store, push, title=title, steps=count)
        for push, title in shown_pushes(models, measured)
    ]
    labels = labels_of(measured.header.models)
    named = f"{len(models)} model{'s' * (len(models) > 1)}"
    regions = in_words(coverage_of(measured), labels)
    with TemporaryDirectory() as folder:
        about = Report(
            title=f"Predictions of {store.path.resolve().name}",
            subtitle=f"Errors of {named} on {store.info.pushes} pushes",
            summary="\n\n".join(f"{each}." for each in regions),
            table=summarise(measured),
            figures=list(_figures(models, store, count, Path(folder))),
            replays=replays,
            manifest=read_json(store.path / CONFIG),
            commands=(command,),
        )
        return write_report(about, path)


def shown_pushes(models: Sequence[Model], measured: Measurements) -> Iterator[Shown]:
    """Yield the push of the first model's median error, and of the last one's largest.

    The error is that of the final position, over all bodies.
    """
    styles = styles_of([model.name for model in models], measured.header.models)
    for model, word, share in ((models[0], "median", 0.5), (models[-1], "largest", 1)):
        error = measured.values("final_pos_mm", model.name).mean(axis=-1)
        order = np.argsort(error)[: np.isfinite(error).sum()]
        if len(order):
            push = int(order[round(share * (len(order) - 1))])
            label = styles[model.name].label
            row = f"Push {measured.data['row'].values[push]} (counted from 0)"
            yield Shown(push, f"{row}: the {word} final error of {label}")


def _figures(
    models: Sequence[Model], store: Store, steps: int, folder: Path
) -> Iterator[tuple[Path, str]]:
    """Yield the errors over time; recorded pushes have no common time."""
    if not store.info.is_recorded:
        curves = error_curves(models, store, steps=steps, pushes=_MOST_AVERAGED)
        path = folder / "error-over-time.svg"
        ids, step = [model.id for model in models], store.info.time_step
        draw_error_over_time(curves, path, time_step=step, models=ids)
        few = f", in the first {_MOST_AVERAGED} pushes"
        part = few * (store.info.pushes > _MOST_AVERAGED)
        yield path, f"Mean position error of each disk over the time of a push{part}."
