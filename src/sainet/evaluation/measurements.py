"""Measurements: errors of models per push, and results of control trials.

One xarray dataset with the dimensions model, training, sample (a push or a trial) and
body; models with fewer training runs are padded with NaN. Its header, a JSON document,
names the models, the conditions and the provenance.
"""

import io
import lzma
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import msgspec
import numpy as np
import xarray as xr

from sainet.models.identity import ModelId
from sainet.runs.documents import UNSEALED, check_sealed, read_file, sealed, write_bytes
from sainet.runs.errors import BadInput
from sainet.runs.manifest import Manifest, manifest

FORMAT_VERSION = 1
PUSHES, TRIALS = ("model", "training", "sample", "body"), ("model", "sample")
_OF_TRIALS = ("solved", "ended", "pushes", "final_mm", "overshoot_mm", "stuck")
DIMENSIONS = {
    **dict.fromkeys(("pos_mm", "rot_deg", "final_pos_mm", "final_rot_deg"), PUSHES),
    **dict.fromkeys(_OF_TRIALS, TRIALS),
    "travel_mm": ("sample", "body"),
    "decision_s": ("model", "sample", "decision"),
    "condition": ("sample",),
    "fold": ("sample",),  # or lab; -1 where neither
    "row": ("sample",),  # of the push in its dataset, or number of the trial
}
_COORDINATES = ("condition", "fold", "row")
_LARGEST = 256 << 20  # bytes of a file, once it is unpacked
_HEADER, _SEAL = "header", "seal"
_BITS = 14  # of the mantissa, in published measurements: a relative error below 1e-4
# Values of four bytes: the byte that a value has at its place predicts the next one.
_FILTERS = [{"id": lzma.FILTER_LZMA2, "preset": 9, "lc": 0, "lp": 2, "pb": 2}]
_REMEDY = "give a file of measurements that sainet wrote"


class Condition(msgspec.Struct, frozen=True, kw_only=True):
    """Pushes or trials that are reported together."""

    label: str = ""  # empty: all samples, without a name
    # What sets it apart: training_pushes, surface, l2, planner, goals, ...
    factors: dict[str, float | str] = {}
    parts: tuple[str, ...] = ()  # labels of other conditions that it joins


class PublishedValues(msgspec.Struct, frozen=True, kw_only=True):
    """Numbers from a publication, to stand beside measured ones."""

    condition: str
    model: ModelId
    values: dict[str, tuple[float | None, ...]]  # by metric, one for each body
    trials: int | None = None  # of control trials


class TrainingRun(msgspec.Struct, frozen=True, kw_only=True):
    """The origin of one training run of a model."""

    model: str  # slug
    seed: int | None = None
    weights: str = ""  # hash of the weights
    data: str = ""  # hash of the training data
    iterations: int | None = None
    final_loss: float | None = None


class TestSet(msgspec.Struct, frozen=True, kw_only=True):
    """The origin of the pushes or trials of one condition."""

    condition: str
    data: str = ""  # hash of the dataset
    settings: dict[str, object] = {}  # that made it


class Provenance(msgspec.Struct, frozen=True, kw_only=True):
    """What measurements were made by: command, data, weights and machine."""

    command: tuple[str, ...] = ()
    note: str = ""  # on their origin, for readers
    tests: tuple[TestSet, ...] = ()
    trainings: tuple[TrainingRun, ...] = ()
    manifest: Manifest | None = None


class Header(msgspec.Struct, frozen=True, kw_only=True):
    """Everything about measurements that is not a number per sample."""

    models: tuple[ModelId, ...]
    conditions: tuple[Condition, ...] = (Condition(),)
    reference_m: float = 0.25  # distance that trans (%) relates to
    published: tuple[PublishedValues, ...] = ()
    # Published predictions are models, but have no training and no interval.
    predictions: tuple[str, ...] = ()  # their slugs
    provenance: Provenance = Provenance()
    has_labs: bool = False  # `fold` numbers labs, not folds of a cross-validation
    format_version: int = FORMAT_VERSION


@dataclass(frozen=True)
class Measurements:
    """A checked dataset of errors or trials, with the identities behind it."""

    data: xr.Dataset
    header: Header

    def __post_init__(self) -> None:
        """Raise `ValueError` if dataset and header do not agree."""
        for name, variable in self.data.variables.items():
            wanted = DIMENSIONS.get(str(name))
            if wanted is None:
                wanted = PUSHES  # a further error
            if variable.dims != wanted:
                raise ValueError(f"{name} has dimensions {variable.dims}, not {wanted}")
        sizes = self.data.sizes
        models = [model.slug for model in self.header.models]
        if len(set(models)) < len(models) or sizes.get("model", 0) != len(models):
            raise ValueError(f"{sizes.get('model')} models are named {models}")
        missing = set(_COORDINATES) - {str(name) for name in self.data.variables}
        if missing:
            raise ValueError(f"{sorted(missing)[0]} is missing")
        places = self.data["condition"].values
        known = len(self.header.conditions)
        if len(places) == 0 or places.min() < 0 or places.max() >= known:
            raise ValueError(f"condition must be below {known} at every sample")

    @property
    def slugs(self) -> list[str]:
        """The slugs of the models, in order."""
        return [model.slug for model in self.header.models]

    @property
    def error_names(self) -> list[str]:
        """The measured errors of pushes; empty for trials."""
        return [str(k) for k, v in self.data.data_vars.items() if v.dims == PUSHES]

    @property
    def is_of_trials(self) -> bool:
        """Whether samples are control trials, not pushes."""
        return "solved" in self.data

    @cached_property
    def _places(self) -> dict[str, list[int]]:
        numbers = {c.label: n for n, c in enumerate(self.header.conditions)}
        return {
            c.label: [numbers[c.label], *(numbers[part] for part in c.parts)]
            for c in self.header.conditions
        }

    def samples_of(self, condition: Condition) -> np.ndarray:
        """Return which samples belong to a condition, or to one of its parts."""
        return np.isin(self.data["condition"].values, self._places[condition.label])

    def values(self, name: str, model: str) -> np.ndarray:
        """Return one variable of a model: without padding, ``[training, ...]``.

        A model without several training runs has no axis for them. An error that was
        not measured, because the metric is newer than the file, is NaN.
        """
        if name not in self.data:
            return np.full_like(self.data["travel_mm"].values, np.nan)
        found = self.data[name].values[self.slugs.index(model)]
        if self.data[name].dims != PUSHES:
            return found
        trained = max(int(np.isfinite(found).any(axis=(1, 2)).sum()), 1)
        return found[:trained] if trained > 1 else found[0]

    def in_condition(self, condition: Condition) -> "Measurements":
        """Return the same measurements with every sample in one condition."""
        places = np.zeros(self.data.sizes["sample"])
        return self.in_conditions((condition,), places)

    def in_conditions(
        self, conditions: tuple[Condition, ...], places: np.ndarray
    ) -> "Measurements":
        """Return the same measurements in other conditions.

        Args:
            conditions: all of them; a union of others owns no samples of its own.
            places: number of the condition of each sample.
        """
        data = self.data.assign_coords(condition=("sample", places.astype(np.int32)))
        return Measurements(
            data, msgspec.structs.replace(self.header, conditions=conditions)
        )

    def of_models(self, slugs: Sequence[str]) -> "Measurements":
        """Return the measurements of some models, in their order."""
        kept = [self.slugs.index(slug) for slug in slugs]
        models = tuple(self.header.models[number] for number in kept)
        header = msgspec.structs.replace(self.header, models=models)
        return Measurements(self.data.isel(model=kept), header)

    def made_by(self, *command: str) -> "Measurements":
        """Return the same measurements with a command and this machine as origin."""
        source = msgspec.structs.replace(
            self.header.provenance, command=command, manifest=manifest()
        )
        header = msgspec.structs.replace(self.header, provenance=source)
        return replace(self, header=header)

    def with_published(self, published: tuple[PublishedValues, ...]) -> "Measurements":
        """Return the same measurements with published values beside them."""
        return replace(
            self, header=msgspec.structs.replace(self.header, published=published)
        )

    def compact(self) -> "Measurements":
        """Return measurements of published precision: about four digits each."""
        names = [str(k) for k, v in self.data.data_vars.items() if v.dtype.kind == "f"]
        return replace(
            self, data=self.data.assign({k: _rounded(self.data[k]) for k in names})
        )

    def to_bytes(self) -> bytes:
        """Return the NetCDF-3 file: equal measurements are equal bytes."""
        # Sorted, so that the order of adding variables does not matter.
        names = sorted(str(name) for name in self.data.variables)
        parts = {n: (self.data[n].dims, self.data[n].values) for n in names}
        attrs = {_HEADER: msgspec.json.encode(self.header).decode(), _SEAL: UNSEALED}
        data = xr.Dataset(parts, attrs=attrs).set_coords([*_COORDINATES])
        return sealed(bytes(data.to_netcdf(engine="scipy", format="NETCDF3_64BIT")))

    def write(self, path: Path) -> None:
        """Write the file, compressed if the name ends in ``.xz``."""
        data = self.to_bytes()
        if path.suffix == ".xz":
            data = lzma.compress(data, filters=_FILTERS)
        write_bytes(path, data)


def measurements_of(
    errors: Mapping[str, np.ndarray],
    travel_mm: np.ndarray,
    header: Header,
    *,
    condition: np.ndarray,
    row: np.ndarray,
) -> Measurements:
    """Return measurements of pushes.

    Args:
        errors: each ``[model, training, push, body]``.
        travel_mm: distance between initial and final position, ``[push, body]``.
        header: names the models and conditions.
        condition: number of the condition of each push.
        row: of each push in its dataset.
    """
    variables = {name: (PUSHES, values) for name, values in errors.items()}
    places = {"condition": condition, "fold": np.full(len(row), -1), "row": row}
    coordinates = {k: ("sample", np.asarray(v, np.int32)) for k, v in places.items()}
    travel = {"travel_mm": (("sample", "body"), travel_mm)}
    return Measurements(xr.Dataset(variables | travel, coordinates), header)


def read_measurements(path: Path) -> Measurements:
    """Read a file of measurements.

    Raises:
        BadInput: it is missing, damaged, edited or no such file, in one line.
    """
    packed = read_file(path, most=_LARGEST)
    try:
        data = _unpack(packed) if path.suffix == ".xz" else packed
        with xr.open_dataset(io.BytesIO(data), engine="scipy") as opened:
            dataset = opened.load()
        header, seal = dataset.attrs.pop(_HEADER), str(dataset.attrs.pop(_SEAL, ""))
        found = Measurements(dataset, msgspec.json.decode(header, type=Header))
    except Exception as cause:  # SciPy raises arbitrary exceptions on corrupt files
        reason = " ".join(str(cause).split())[:200] or type(cause).__name__
        raise BadInput(f"{path}: no measurements ({reason}); {_REMEDY}.") from None
    if seal or path.suffix != ".xz":  # evidence of earlier versions has none
        check_sealed(path, data, seal)
    return found


def _unpack(packed: bytes) -> bytes:
    unpacker = lzma.LZMADecompressor(memlimit=_LARGEST)
    data = unpacker.decompress(packed, max_length=_LARGEST)
    if not unpacker.eof:
        raise ValueError(f"cut off, or over {_LARGEST} bytes")
    return data


def _rounded(values: xr.DataArray) -> xr.DataArray:
    """Return single-precision values whose last bits are zero: they compress well."""
    single = np.ascontiguousarray(values.values, np.float32)
    bits = single.view(np.uint32)
    spare = 23 - _BITS
    near = (bits + np.uint32(1 << (spare - 1))) & np.uint32(
        0xFFFFFFFF >> spare << spare
    )
    rounded = np.where(np.isfinite(single), near, bits).view(np.float32)
    return values.copy(data=rounded)
