"""Stores read back what was written, and errors name what is wrong."""

import json
import os
import shutil

import numpy as np
import pytest
import xarray
from msgspec import structs

from sainet.datasets.schema import ARRAYS, StoreInfo, variables
from sainet.datasets.store import open_store
from sainet.datasets.writer import write_store
from sainet.runs.documents import content_hash
from sainet.runs.errors import BadInput, BadStore

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


@pytest.mark.parametrize("name", ["config.json", "manifest.json"])
def test_a_store_of_unknown_origin_is_refused(copy, name):
    (copy / name).unlink()
    assert f"{name}: missing, so the origin of the pushes is unknown" in refusal(copy)


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


@pytest.mark.parametrize(
    "files",
    [None, [], {}, {"zarr.json": 3}, {"zarr.json": None}, {"/dev/zero": "0" * 64}],
)
def test_a_damaged_list_of_hashes_is_refused(copy, files):
    edit(copy / "hashes.json", lambda found: found.update(files=files))
    refusal(copy)


def test_a_chunk_without_a_hash_is_named(copy):
    name = CHUNK.removeprefix("pushes.zarr/")
    edit(copy / "hashes.json", lambda found: found["files"].pop(name))
    assert f"{name} has no hash" in refusal(copy)


def test_a_newer_store_asks_for_a_newer_sainet(copy):
    edit(copy / "hashes.json", lambda found: found.update(format_version=3))
    message = refusal(copy)
    assert "format_version is 3" in message
    assert "upgrade" in message


def test_newer_attributes_ask_for_a_newer_sainet(copy):
    edit_attributes(copy, lambda found: found.update(format_version=7))
    assert "format_version is 7" in refusal(copy)


def test_an_earlier_format_is_one_clear_line(copy):
    edit(copy / "hashes.json", lambda found: found.update(format_version=1))
    message = refusal(copy)
    assert message == (
        f"{copy / 'hashes.json'}: format_version is 1, not 2: it was made by an "
        "earlier version of sainet; make it again."
    )


@pytest.mark.parametrize("version", [None, "1", 0, -1, 1.5, [1]])
def test_an_unknown_version_is_refused(copy, version):
    edit(copy / "hashes.json", lambda found: found.update(format_version=version))
    assert "format_version" in refusal(copy)


@pytest.mark.parametrize("attributes", [[], None, 3])
def test_invalid_attributes_are_refused(copy, attributes):
    edit(copy / ATTRIBUTES, lambda found: found.update(attributes=attributes))
    assert f"{ATTRIBUTES}: attributes: expected" in refusal(copy)


@pytest.mark.parametrize("name", ["kind", "pushes", "time_step", "engine"])
def test_a_missing_attribute_is_named(copy, name):
    edit_attributes(copy, lambda found: found.pop(name))
    message = refusal(copy)
    assert f"missing required field `{name}`" in message
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
        {"assumed_engines": ["../../planar"]},
        {"steps": 10**9},
        {"steps": -(2**31)},
        {"pushes": 10**30},
        {"time_step": 1e-46},
        {"seed": -1},
        {"damping": -1.0},
        {"groups": [""]},
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
    path = whole_store / ARRAYS
    dataset = xarray.open_zarr(path, consolidated=False, chunks=None)
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


def rehash(folder):
    """Makes the list of hashes agree with the files: damage that hashes do not show."""
    arrays = folder / "pushes.zarr"

    def hashed(found):
        for name in found["files"]:
            found["files"][name] = content_hash((arrays / name).read_bytes())

    edit(folder / "hashes.json", hashed)


@pytest.mark.parametrize(
    "change",
    [
        {"shape": [28, 10**9, 2, 6]},
        {"shape": [28, -1, 2, 6]},
        {"data_type": "float64"},
        {"data_type": 3},
        {"codecs": [{"name": "bytes"}]},
        {
            "codecs": [
                {"name": "bytes"},
                {"name": "gzip", "configuration": {"level": 1}},
            ]
        },
        {"codecs": [{"name": "bytes"}, {"name": "zstd"}]},
        {"codecs": "zstd"},
        {"chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [1]}}},
        {"chunk_key_encoding": {"name": "v2"}},
        {"fill_value": [1]},
        {"dimension_names": ["push"]},
        {"zarr_format": 2},
        {"node_type": "group"},
    ],
)
def test_metadata_that_the_writer_does_not_write_are_refused(copy, change):
    edit(copy / "pushes.zarr/truth/zarr.json", lambda found: found.update(change))
    rehash(copy)
    assert "pushes.zarr/truth" in refusal(copy)


def cut(data: bytes) -> bytes:
    return data[: len(data) // 2]


DAMAGE = {
    "doubled": lambda data: data + data,
    "cut": cut,
    "empty": lambda data: b"",
    "zeros": lambda data: bytes(len(data)),
    "flipped": lambda data: data[:40] + bytes([data[40] ^ 255]) + data[41:],
    # A frame that declares terabytes.
    "bomb": lambda data: data[:4] + b"\xe0" + b"\xff" * 8 + data[9:],
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_chunks_with_matching_hashes_are_one_line(copy, damage):
    before = (copy / CHUNK).read_bytes()
    (copy / CHUNK).write_bytes(DAMAGE[damage](before))
    rehash(copy)
    try:
        open_store(copy).read(slice(None))
    except BadStore as error:
        assert "pushes.zarr/truth" in str(error) and "\n" not in str(error)
    else:  # nothing else was read than what was written
        assert damage in ("doubled", "flipped")


@pytest.mark.parametrize("name", ["/dev/zero", "../../../etc/passwd", "truth/other"])
def test_the_list_of_hashes_names_files_of_the_dataset_only(copy, name):
    edit(copy / "hashes.json", lambda found: found["files"].update({name: "0" * 64}))
    assert "is not a file of this dataset" in refusal(copy)


@pytest.mark.parametrize("name", [CHUNK, ATTRIBUTES, "hashes.json"])
def test_pipes_and_devices_are_refused_at_once(copy, name):
    (copy / name).unlink()
    os.mkfifo(copy / name)
    assert "not a regular file" in refusal(copy)
    (copy / name).unlink()
    os.symlink("/dev/zero", copy / name)
    assert "not a regular file" in refusal(copy)


BAD_VALUES = [
    ("mass", -1.0, "mass is -1"),
    ("mass", np.nan, "mass is nan"),
    ("radius", 0.0, "radius is 0"),
    ("radius", 55.0, "radius is 55"),
    ("pusher_radius", -0.0048, "pusher radius is"),
    ("table_friction", -0.1, "friction is -0.1"),
    ("disk_friction", 1e30, "friction is 1e+30"),
    ("steps", -1, "steps is -1"),
    ("steps", 10**9, "steps is 1e+09"),
    ("group", 7, "group is 7"),
    ("truth", np.nan, "position is nan"),
    ("truth", 1e30, "position is 1e+30"),
    ("truth_pusher", np.inf, "position is inf"),
    ("measured", np.nan, "position is nan"),
    ("initial", np.nan, "position is nan"),
    ("simulated_planar", np.nan, "position is nan"),
    ("command_velocity", 1e10, "velocity is 1e+10"),
    ("pose_observed", 7, "flag is 7"),
]


@pytest.mark.parametrize(("name", "value", "says"), BAD_VALUES)
def test_impossible_values_name_array_push_and_value(
    whole_store, tmp_path, name, value, says
):
    store = open_store(whole_store)
    arrays = store.read(slice(None))
    arrays[name][(3, *[0] * (arrays[name].ndim - 1))] = value
    write_store(tmp_path / "bad", store.info, arrays)
    bad = open_store(tmp_path / "bad")
    with pytest.raises(BadStore) as refused:
        bad.read(slice(2, 9), (name,))
    assert f"pushes.zarr/{name}: push 3: {says}" in str(refused.value)
    assert "delete" in str(refused.value) and "\n" not in str(refused.value)
    with pytest.raises(BadStore, match="push 3: "):
        bad.take([9, 3, 0]).read(slice(None), (name,))
    bad.read(slice(4, 9), (name,))


def test_what_was_not_observed_may_be_unknown(whole_store, tmp_path):
    store = open_store(whole_store)
    arrays = store.read(slice(None))
    arrays["rate_observed"][3] = 0
    arrays["truth"][3, ..., 3:] = np.nan
    arrays["truth"][4, 30:] = np.nan
    arrays["steps"][4] = 30
    write_store(tmp_path / "store", store.info, arrays)
    found = open_store(tmp_path / "store").read(slice(None), ("truth",))["truth"]
    np.testing.assert_array_equal(found, arrays["truth"])
    arrays["steps"][4] = 31
    write_store(tmp_path / "other", store.info, arrays)
    with pytest.raises(BadStore, match="truth: push 4: position is nan"):
        open_store(tmp_path / "other").read(slice(None), ("truth",))


def test_properties_out_of_range_are_not_written(whole_store, tmp_path):
    store = open_store(whole_store)
    info = structs.replace(store.info, time_step=-1.0)
    with pytest.raises(BadInput, match="time_step: expected"):
        write_store(tmp_path / "store", info, store.read(slice(None)))


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
        name: rng.uniform(0.1, 0.9, [sizes[d] for d in variable.dimensions]).astype(
            variable.dtype
        )
        for name, variable in variables(info).items()
    }
    arrays["steps"] += 4
    arrays["truth"][1] = np.nan  # no flag claims that it was observed
    write_store(tmp_path / "store", info, arrays)
    store = open_store(tmp_path / "store")
    assert store.info == info
    for name, values in store.read(slice(None)).items():
        np.testing.assert_array_equal(values, arrays[name], err_msg=name)
