"""Stores read back what was written, and errors name what is wrong."""

import json
import os
import shutil

import numpy as np
import pytest

from sainet.datasets.schema import StoreInfo, variables
from sainet.datasets.store import open_store
from sainet.datasets.writer import write_store
from sainet.runs.documents import content_hash
from sainet.runs.errors import BadStore

CHUNK = "pushes.zarr/truth/c/1/0/0/0"
ATTRIBUTES = "pushes.zarr/zarr.json"


@pytest.fixture
def copy(whole_store, tmp_path):
    return shutil.copytree(whole_store, tmp_path / "copy")


def refusal(folder, **options) -> str:
    with pytest.raises(BadStore) as refused:
        open_store(folder, **options)
    message = str(refused.value)
    assert "\n" not in message
    assert str(folder) in message
    return message


def edit(path, change):
    value = json.loads(path.read_text())
    change(value)
    path.write_text(json.dumps(value))


def edit_attributes(folder, change):
    """Changes the attributes, and the list of hashes with them."""
    edit(folder / ATTRIBUTES, lambda found: change(found["attributes"]))
    known = content_hash((folder / ATTRIBUTES).read_bytes())
    edit(
        folder / "hashes.json",
        lambda found: found["files"].update({"zarr.json": known}),
    )


def test_a_missing_store_names_the_command_that_makes_one(tmp_path):
    assert "sainet generate" in refusal(tmp_path / "none")


def test_an_impossible_folder_name_is_refused(tmp_path):
    assert "cannot be read" in refusal(tmp_path / ("x" * 300))


def test_an_unfinished_store_names_the_command_that_resumes(copy):
    (copy / "hashes.json").unlink()
    message = refusal(copy)
    assert "hashes.json" in message
    assert "again" in message


@pytest.mark.parametrize("verify", [True, False])
def test_a_deleted_chunk_is_named(copy, verify):
    (copy / CHUNK).unlink()
    assert f"{CHUNK}: missing" in refusal(copy, verify=verify)


def test_a_truncated_chunk_is_named(copy):
    os.truncate(copy / CHUNK, 100)
    message = refusal(copy)
    assert f"{CHUNK}: truncated or changed" in message
    # A finished folder stays unchanged, so the same command does nothing.
    assert f"delete {copy}, then run the command that made it again" in message


def test_a_flipped_byte_is_found(copy):
    data = bytearray((copy / CHUNK).read_bytes())
    data[len(data) // 2] ^= 1
    (copy / CHUNK).write_bytes(data)
    assert f"{CHUNK}: truncated or changed" in refusal(copy)


@pytest.mark.parametrize("text", ["", "{", "[]", "\x00\xff", '{"files": {}}'])
def test_an_invalid_list_of_hashes_is_refused(copy, text):
    (copy / "hashes.json").write_text(text)
    assert "hashes.json" in refusal(copy)


@pytest.mark.parametrize("files", [None, [], {}, {"zarr.json": 3}, {"zarr.json": None}])
def test_a_damaged_list_of_hashes_is_refused(copy, files):
    edit(copy / "hashes.json", lambda found: found.update(files=files))
    refusal(copy)


def test_a_chunk_without_a_hash_is_named(copy):
    name = CHUNK.removeprefix("pushes.zarr/")
    edit(copy / "hashes.json", lambda found: found["files"].pop(name))
    assert f"{name} has no hash" in refusal(copy)


def test_a_newer_store_asks_for_a_newer_sainet(copy):
    edit(copy / "hashes.json", lambda found: found.update(format_version=2))
    message = refusal(copy)
    assert "format_version is 2" in message
    assert "upgrade" in message


def test_newer_attributes_ask_for_a_newer_sainet(copy):
    edit_attributes(copy, lambda found: found.update(format_version=7))
    assert "format_version is 7" in refusal(copy)


@pytest.mark.parametrize("version", [None, "1", 0, -1, 1.5, [1]])
def test_an_unknown_version_is_refused(copy, version):
    edit(copy / "hashes.json", lambda found: found.update(format_version=version))
    assert "format_version is" in refusal(copy)


@pytest.mark.parametrize("attributes", [[], None, 3])
def test_invalid_attributes_are_refused(copy, attributes):
    edit(copy / ATTRIBUTES, lambda found: found.update(attributes=attributes))
    assert f"{ATTRIBUTES}: attributes are missing" in refusal(copy)


@pytest.mark.parametrize("name", ["kind", "pushes", "time_step", "seed"])
def test_a_missing_attribute_is_named(copy, name):
    edit_attributes(copy, lambda found: found.pop(name))
    message = refusal(copy)
    assert f"{name} is missing" in message
    assert ATTRIBUTES in message


@pytest.mark.parametrize(
    "damage", [{"bodies": 3}, {"pushes": 29}, {"assumed_engines": ["bullet"]}]
)
def test_attributes_that_contradict_the_arrays_are_refused(copy, damage):
    edit_attributes(copy, lambda found: found.update(damage))
    refusal(copy)


@pytest.mark.parametrize(
    "damage",
    [
        {"kind": "telekinesis"},
        {"pushes": "many"},
        {"pushes": 0},
        {"chunk_size": 0},
        {"time_step": -1.0},
        {"assumed_engines": 5},
    ],
)
def test_impossible_attributes_are_refused(copy, damage):
    edit_attributes(copy, lambda found: found.update(damage))
    assert ATTRIBUTES in refusal(copy)


def test_a_part_is_read_as_it_was_written(whole_store):
    store = open_store(whole_store)
    whole = store.read(slice(None))
    assert whole.keys() == variables(store.info).keys()
    part = store.read(slice(3, 17), ("truth", "mass"))
    assert part.keys() == {"truth", "mass"}
    for name, values in part.items():
        np.testing.assert_array_equal(values, whole[name][3:17])
        assert values.dtype == np.float32


def test_xarray_reads_dimensions_and_units(whole_store):
    store = open_store(whole_store)
    assert store.first(3).to_xarray().sizes["push"] == 3
    dataset = store.to_xarray()
    for name, variable in variables(store.info).items():
        assert dataset[name].dims == variable.dimensions
        assert dataset[name].attrs["units"] == variable.units
        assert dataset[name].attrs["long_name"] == variable.meaning
    assert dataset.attrs["engine"] == "planar"
    np.testing.assert_array_equal(
        dataset["truth"][4:6].values, store.read(slice(4, 6), ("truth",))["truth"]
    )


def test_content_changes_with_the_store(whole_store, copy):
    before = open_store(whole_store).content
    assert open_store(copy).content == before
    edit_attributes(copy, lambda found: found.update(seed=5))
    assert open_store(copy).content != before


def test_repeats_default_to_unique(copy):
    def forget(found: dict) -> None:
        del found["has_repeats"]

    edit_attributes(copy, forget)
    store = open_store(copy)
    assert store.repeats().tolist() == list(range(store.info.pushes))


def test_a_store_in_memory_is_written_and_read_back(tmp_path):
    info = StoreInfo(
        kind="robot",
        pushes=5,
        bodies=1,
        steps=4,
        chunk_size=2,
        time_step=1 / 240,
        engine="recorded",
        groups=("abs-10", "größer"),
        published=("convex",),
        has_repeats=True,
    )
    rng = np.random.default_rng(0)
    sizes = {"push": 5, "time": 4, "body": 1, "motion": 6, "pose": 3, "xy": 2}
    arrays = {
        name: rng.normal(size=[sizes[d] for d in variable.dimensions]).astype(
            variable.dtype
        )
        for name, variable in variables(info).items()
    }
    arrays["truth"][1] = np.nan
    write_store(tmp_path / "store", info, arrays)
    store = open_store(tmp_path / "store")
    assert store.info == info
    for name, values in store.read(slice(None)).items():
        np.testing.assert_array_equal(values, arrays[name], err_msg=name)
