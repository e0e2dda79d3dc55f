"""Measurements joined: training runs into models, and conditions, folds and models.

All keep the order of models, conditions and samples: outer joins would sort them.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

import msgspec
import numpy as np
import xarray as xr

from sainet.evaluation.conditions import Condition, Header, Provenance
from sainet.evaluation.measurements import PUSHES, Measurements
from sainet.models.identity import ModelId

T = TypeVar("T")


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
    return Measurements(data, _replace(measured.header, models=models))


def join(parts: Sequence[Measurements]) -> Measurements:
    """Return the samples of all parts, one after another: conditions, or folds."""
    models = _distinct(model for part in parts for model in part.header.models)
    conditions = _distinct(c for part in parts for c in part.header.conditions)
    slugs = [model.slug for model in models]
    labels = [condition.label for condition in conditions]
    sizes = {
        name: max(part.data.sizes.get(name, 0) for part in parts)
        for name in ("training", "body", "decision")
    } | {"model": len(models)}
    names = dict.fromkeys(str(name) for part in parts for name in part.data.variables)
    found: dict[str, tuple[Any, np.ndarray]] = {}
    for name in names:
        dims = next(p.data[name].dims for p in parts if name in p.data.variables)
        values = [_widened(part, name, dims, slugs, sizes) for part in parts]
        if name == "condition":
            values = [
                np.array([labels.index(c.label) for c in part.header.conditions])[place]
                for part, place in zip(parts, values, strict=True)
            ]
        if dims == ("sample",):
            values = [each.astype(np.int32) for each in values]
        axis = dims.index("sample")
        found[name] = dims, np.concatenate(values, axis=axis)
    data = xr.Dataset(found).set_coords(["condition", "fold", "row"])
    return Measurements(data, _joined_header(parts, models, conditions))


def _widened(
    part: Measurements,
    name: str,
    dims: tuple[Any, ...],
    slugs: Sequence[str],
    sizes: Mapping[str, int],
) -> np.ndarray:
    """Return one variable of a part, padded with NaN to all models and bodies."""
    samples = part.data.sizes["sample"]
    if dims == ("sample",):
        return part.data[name].values
    wide = np.full([sizes.get(str(dim), samples) for dim in dims], np.nan)
    if name not in part.data:
        return wide
    values = part.data[name].values
    place: list[Any] = [slice(size) for size in values.shape]
    if "model" in dims:
        place[0] = [slugs.index(slug) for slug in part.slugs]
    wide[tuple(place)] = values
    return wide


def add_models(measured: Measurements, other: Measurements) -> Measurements:
    """Return measurements with the models of others, of the very same samples."""
    names = measured.error_names
    most = max(measured.data.sizes["training"], other.data.sizes["training"])

    def padded(values: np.ndarray) -> np.ndarray:
        width = [(0, 0)] * 4
        width[1] = 0, most - values.shape[1]
        return np.pad(values, width, constant_values=np.nan)

    both = {
        name: np.concatenate(
            [padded(one.data[name].values) for one in (measured, other)]
        )
        for name in names
    }
    data = measured.data.drop_vars(names).assign(
        {name: (PUSHES, values) for name, values in both.items()}
    )
    models = (*measured.header.models, *other.header.models)
    return Measurements(data, _replace(measured.header, models=models))


def without_predictions(measured: Measurements) -> Measurements:
    """Return measurements without the published predictions."""
    header = measured.header
    kept = [n for n, m in enumerate(header.models) if m.slug not in header.predictions]
    models = tuple(header.models[number] for number in kept)
    return Measurements(
        measured.data.isel(model=kept), _replace(header, models=models, predictions=())
    )


def _joined_header(
    parts: Sequence[Measurements],
    models: tuple[ModelId, ...],
    conditions: tuple[Condition, ...],
) -> Header:
    headers = [part.header for part in parts]
    sources = [header.provenance for header in headers]
    first = headers[0]
    return _replace(
        first,
        models=models,
        conditions=conditions,
        published=_distinct(each for header in headers for each in header.published),
        predictions=_distinct(slug for h in headers for slug in h.predictions),
        provenance=Provenance(
            command=first.provenance.command,
            note=first.provenance.note,
            tests=_distinct(test for source in sources for test in source.tests),
            trainings=_distinct(run for each in sources for run in each.trainings),
            manifest=first.provenance.manifest,
        ),
    )


def _distinct(values: Iterable[T]) -> tuple[T, ...]:
    """Return values without repetitions, in the order in which they first occur."""
    found: list[T] = []
    for value in values:
        if value not in found:
            found.append(value)
    return tuple(found)


def _replace(header: Header, **changes: Any) -> Header:  # noqa: ANN401
    return msgspec.structs.replace(header, **changes)
