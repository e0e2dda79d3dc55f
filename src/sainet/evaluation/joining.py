"""Measurements joined: training runs into models, and conditions, folds and models.

All keep the order of models, conditions and samples: outer joins would sort them.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

import numpy as np
import xarray as xr
from msgspec.structs import replace

from sainet.datasets.splits import Fold
from sainet.evaluation.measurements import PUSHES, Header, Measurements
from sainet.models.identity import ModelId

T = TypeVar("T")
_PADDED = ("training", "body", "decision")  # dimensions that parts may have less of


def pool_trainings(
    measured: Measurements, pools: Mapping[ModelId, Sequence[str]]
) -> Measurements:
    """Make one model of several training runs of it, in the place of the first.

    Args:
        measured: each training run as a model.
        pools: the slugs of the training runs of each model.
    """
    whole = {runs[0]: (identity, runs) for identity, runs in pools.items()}
    rest = {run for runs in pools.values() for run in runs[1:]}
    kept = [model for model in measured.header.models if model.slug not in rest]
    runs_of = [whole.get(m.slug, (m, [m.slug])) for m in kept]
    numbers = [[measured.slugs.index(run) for run in runs] for _, runs in runs_of]
    most = max(map(len, numbers))

    def pooled(values: np.ndarray) -> np.ndarray:
        found = np.full((len(kept), most, *values.shape[2:]), np.nan)
        for place, trained in enumerate(numbers):
            found[place, : len(trained)] = values[trained, 0]
        return found

    names = measured.error_names
    data = measured.data.drop_vars(names).assign(
        {name: (PUSHES, pooled(measured.data[name].values)) for name in names}
    )
    models = tuple(identity for identity, _ in runs_of)
    return Measurements(data, replace(measured.header, models=models))


def join(parts: Sequence[Measurements]) -> Measurements:
    """Return the samples of all parts, one after another: conditions, or folds."""
    header = _joined_header([part.header for part in parts])
    slugs = [model.slug for model in header.models]
    labels = [condition.label for condition in header.conditions]
    padded = [
        each.assign_coords(model=part.slugs).reindex(model=slugs)
        for part, each in zip(parts, _padded(parts), strict=True)
    ]
    places = [
        np.array([labels.index(c.label) for c in part.header.conditions])[
            part.data["condition"].values
        ]
        for part in parts
    ]
    data = xr.concat(
        padded, "sample", data_vars="minimal", coords="minimal", compat="override"
    )
    data = data.drop_vars(["model", *_PADDED], errors="ignore")
    return Measurements(
        data.assign_coords(
            condition=("sample", np.concatenate(places).astype(np.int32))
        ),
        header,
    )


def join_folds(parts: Sequence[tuple[Fold, Measurements]]) -> Measurements:
    """Return the measurements of all pushes, each by models not trained on it.

    Args:
        parts: of every fold, with the same models in each; together their tests are
            all pushes of interest, each once.
    """
    rows = np.concatenate([fold.rows for fold, _ in parts]).astype(np.int32)
    numbers = [np.full(len(fold.rows), fold.number, np.int32) for fold, _ in parts]
    whole = join([measured for _, measured in parts])
    data = whole.data.assign_coords(
        fold=("sample", np.concatenate(numbers)), row=("sample", rows)
    )
    return Measurements(data.isel(sample=np.argsort(rows)), whole.header)


def add_models(measured: Measurements, other: Measurements) -> Measurements:
    """Return measurements with the models of others, of the very same samples."""
    names = measured.error_names
    ours, theirs = (each[names] for each in _padded([measured, other]))
    errors = xr.concat([ours, theirs], "model", join="exact", compat="equals")
    errors = errors.drop_vars(_PADDED, errors="ignore")
    models = (*measured.header.models, *other.header.models)
    return Measurements(
        measured.data.drop_vars(names).assign(errors.data_vars),
        replace(measured.header, models=models),
    )


def without_predictions(measured: Measurements) -> Measurements:
    """Return measurements without the published predictions."""
    header = measured.header
    kept = [n for n, m in enumerate(header.models) if m.slug not in header.predictions]
    models = tuple(header.models[number] for number in kept)
    return Measurements(
        measured.data.isel(model=kept), replace(header, models=models, predictions=())
    )


def _padded(parts: Sequence[Measurements]) -> list[xr.Dataset]:
    """Return the data of all parts, padded with NaN to one size but for samples."""
    sizes = [{k: part.data.sizes.get(k, 0) for k in _PADDED} for part in parts]
    padded: list[xr.Dataset] = []
    for part, known in zip(parts, sizes, strict=True):
        present = [name for name in _PADDED if known[name]]
        numbered = part.data.assign_coords({k: np.arange(known[k]) for k in present})
        widest = {k: np.arange(max(size[k] for size in sizes)) for k in present}
        padded.append(numbered.reindex(widest))
    return padded


def _joined_header(headers: Sequence[Header]) -> Header:
    first, sources = headers[0], [header.provenance for header in headers]
    return replace(
        first,
        models=_distinct(model for header in headers for model in header.models),
        conditions=_distinct(c for header in headers for c in header.conditions),
        published=_distinct(each for header in headers for each in header.published),
        predictions=_distinct(slug for h in headers for slug in h.predictions),
        provenance=replace(
            first.provenance,
            tests=_distinct(test for source in sources for test in source.tests),
            trainings=_distinct(run for each in sources for run in each.trainings),
        ),
    )


def _distinct(values: Iterable[T]) -> tuple[T, ...]:
    """Return values without repetitions, in the order in which they first occur."""
    found: list[T] = []
    for value in values:
        if value not in found:
            found.append(value)
    return tuple(found)
