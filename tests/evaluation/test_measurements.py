"""Measurements: files that come back equal, joins that keep order, hostile files."""

import lzma

import msgspec
import numpy as np
import pytest
import xarray as xr

from sainet.evaluation.as_json import to_json_object
from sainet.evaluation.joining import add_models, join, pool_trainings
from sainet.evaluation.measurements import (
    Condition,
    Header,
    Measurements,
    Provenance,
    measurements_of,
    read_measurements,
)
from sainet.evaluation.metrics import MEASURED
from sainet.evaluation.summary import summarise
from sainet.models.identity import ModelId
from sainet.runs.errors import BadInput


def measured(names=("physics", "in"), pushes=6, condition="", seed=0):
    rng = np.random.default_rng(seed)
    shape = len(names), 1, pushes, 2
    header = Header(
        models=tuple(ModelId(kind="in", name=name) for name in names),
        conditions=(Condition(label=condition, factors={"l2": 1e-3}),),
        provenance=Provenance(command=("sainet", "evaluate")),
    )
    rows = np.arange(pushes)
    errors = {name: rng.uniform(1, 9, shape) for name in MEASURED}
    travel = rng.uniform(5, 9, (pushes, 2))
    return measurements_of(errors, travel, header, condition=0 * rows, row=rows)


@pytest.mark.parametrize("name", ["a.nc", "a.nc.xz"])
def test_a_file_comes_back_and_is_the_same_bytes(tmp_path, name):
    one = measured()
    for path in (tmp_path / name, tmp_path / "again" / name):
        one.write(path)
    assert (tmp_path / name).read_bytes() == (tmp_path / "again" / name).read_bytes()
    found = read_measurements(tmp_path / name)
    assert found.header == one.header
    for variable in one.data.variables:
        np.testing.assert_array_equal(found.data[variable], one.data[variable])
    assert found.to_bytes() == one.to_bytes()


def test_published_precision_keeps_four_digits():
    one = measured(pushes=50)
    kept = one.compact()
    for name in MEASURED:
        np.testing.assert_allclose(kept.data[name], one.data[name], rtol=4e-5)
    assert kept.compact().to_bytes() == kept.to_bytes()
    assert len(lzma.compress(kept.to_bytes())) < 0.6 * len(one.to_bytes())


def test_joining_keeps_the_order_of_models_and_pads_what_is_missing():
    one = measured(("z", "b"), condition="first", seed=1)
    other = measured(("b", "a"), condition="then", pushes=4, seed=2)
    whole = join([one, other])
    assert whole.slugs == ["z", "b", "a"]
    assert [c.label for c in whole.header.conditions] == ["first", "then"]
    np.testing.assert_array_equal(whole.data["condition"], [0] * 6 + [1] * 4)
    found = whole.values("pos_mm", "b")
    np.testing.assert_array_equal(found[:6], one.values("pos_mm", "b"))
    np.testing.assert_array_equal(found[6:], other.values("pos_mm", "b"))
    assert np.isnan(whole.values("pos_mm", "a")[:6]).all()


def test_a_union_of_conditions_owns_their_samples():
    whole = join([measured(condition=name) for name in ("abs", "plywood")])
    union = Condition(label="all", parts=("abs", "plywood"))
    places = whole.data["condition"].values
    found = whole.in_conditions((*whole.header.conditions, union), places)
    assert found.samples_of(union).all()
    assert found.samples_of(found.header.conditions[0]).sum() == 6


def test_models_with_fewer_trainings_are_padded_and_come_back_whole():
    runs = measured(("physics", "in-0", "in-1"))
    identity = ModelId(kind="in")
    pooled = pool_trainings(runs, {identity: ["in-0", "in-1"]})
    assert pooled.slugs == ["physics", "in"]
    assert pooled.values("pos_mm", "in").shape == (2, 6, 2)
    assert pooled.values("pos_mm", "physics").shape == (6, 2)
    more = add_models(pooled, measured(("other",)))
    assert more.slugs == ["physics", "in", "other"]
    assert more.values("pos_mm", "other").shape == (6, 2)


def test_headers_that_do_not_fit_are_refused():
    one = measured()
    same = msgspec.structs.replace(one.header, models=one.header.models[:1] * 2)
    with pytest.raises(ValueError, match="are named"):
        type(one)(one.data, same)
    with pytest.raises(ValueError, match="condition must be below 0"):
        type(one)(one.data, msgspec.structs.replace(one.header, conditions=()))


def test_edited_measurements_are_refused(tmp_path):
    path, packed = tmp_path / "a.nc", tmp_path / "a.nc.xz"
    measured().write(path)
    with xr.open_dataset(path, engine="scipy") as opened:
        edited = opened.load() * 1
    edited["pos_mm"] *= 0.1
    attributes = opened.attrs
    header = {"header": attributes["header"]}
    for kept in (attributes, header | {"seal": 5}, header):
        edited.attrs = kept
        data = edited.to_netcdf(engine="scipy")
        path.write_bytes(bytes(data))
        with pytest.raises(BadInput, match=r"a\.nc: seal: .*edited.* Delete it"):
            read_measurements(path)
        packed.write_bytes(lzma.compress(bytes(data)))
    read_measurements(packed)  # evidence of earlier versions has no seal


def test_hostile_files_get_one_line(tmp_path):
    path = tmp_path / "a.nc"
    whole = measured().to_bytes()
    rng = np.random.default_rng(0)
    cases = [b"", b"CDF", whole[:100], whole[: len(whole) // 2], b"\0" * 300]
    for _ in range(40):
        place = rng.integers(len(whole) // 2)
        cases.append(whole[:place] + rng.bytes(4) + whole[place + 4 :])
    refused = 0
    for data in cases:
        path.write_bytes(data)
        try:
            read_measurements(path)
        except BadInput as error:
            refused += 1
            assert str(error).startswith(f"{path}: ")
            assert len(str(error).splitlines()) == 1
    assert refused >= 5
    (tmp_path / "b.nc.xz").write_bytes(lzma.compress(whole)[:50])
    with pytest.raises(BadInput, match="cut off"):
        read_measurements(tmp_path / "b.nc.xz")


def test_an_error_that_the_file_does_not_have_is_unknown():
    """A metric that is newer than a file leaves its tables as they are."""
    found = measured()
    older = Measurements(found.data.drop_vars("rot_deg"), found.header)
    rows = to_json_object(summarise(older))
    assert all(row["rot_deg"] is None for row in rows["rows"])
    assert {each["metric"] for each in rows["comparisons"]} == {
        each["metric"]
        for each in to_json_object(summarise(found))["comparisons"]
        if each["metric"] != "rot_deg"
    }
