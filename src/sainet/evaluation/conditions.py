"""Conditions, published values and provenance: the header of measurements."""

import msgspec

from sainet.models.identity import ModelId
from sainet.runs.manifest import Manifest

FORMAT_VERSION = 1


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


class Training(msgspec.Struct, frozen=True, kw_only=True):
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
    note: str = ""  # anything a reader has to be told of their origin
    tests: tuple[TestSet, ...] = ()
    trainings: tuple[Training, ...] = ()
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
    format_version: int = FORMAT_VERSION
