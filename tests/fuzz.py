"""Mutates every kind of file and option that the package reads, and watches.

    python tests/fuzz.py --cases 2000 --seed 0

makes small real inputs once, then damages a copy of one of them in each case and reads
it as the commands do, in this process. A case passes where the damage is one short
line (a `SainetError`, or exit status 2), or where what was read is possible: no
traceback, no hang, no flood of memory and no impossible value that is silently
accepted. `--case 17` runs one case again and prints what it raises.
"""

import argparse
import contextlib
import io
import json
import math
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from unittest import mock

import msgspec
import numpy as np
from msgspec import structs

TESTS = Path(__file__).resolve().parent
for folder in (TESTS, TESTS.parent / "src"):
    sys.path.insert(0, str(folder))

from sainet.cli.entry import parse  # noqa: E402
from sainet.cli.help import message  # noqa: E402
from sainet.datasets.config import GenerateConfig  # noqa: E402
from sainet.datasets.generate import generate  # noqa: E402
from sainet.datasets.recorded import own  # noqa: E402
from sainet.datasets.schema import variables  # noqa: E402
from sainet.datasets.store import open_store  # noqa: E402
from sainet.datasets.writer import write_store  # noqa: E402
from sainet.engines.simulator import InternalEngine, PlanarSpec  # noqa: E402
from sainet.models.card import (  # noqa: E402
    Estimate,
    Identified,
    read_card,  # noqa: E402
    read_identified,
)
from sainet.models.library import load_model  # noqa: E402
from sainet.runs.documents import (  # noqa: E402
    content_hash,
    write_document,
    write_json,
)
from sainet.runs.errors import SainetError  # noqa: E402
from sainet.runs.folders import open_run  # noqa: E402
from sainet.scenes.recording import CameraOffset  # noqa: E402
from support import write_sealed  # noqa: E402

SLOWEST = 10.0  # s for one case
MOST_MEMORY = 2 << 20  # kB that one case may add
MOST_DATA = 8 << 30  # bytes of this process
LONGEST = 320  # characters of a message

# In the place of a value; what JSON cannot express, `json.dumps` writes as it is.
VALUES = [
    *(None, True, False, -1, 0, 1, 2, 3.5, 10**9, -(2**31), 2**63, 10**30, 10**400),
    *(1e300, -1e300, 1e-46, 1e30, -0.5, math.nan, math.inf, -math.inf, 0.05, 50.0),
    *("", "planar", "x" * 5000, "\ud800", "../..", "/dev/zero", "a\nb", "\x00", "-1"),
    *([], {}, [1], [[]], [None], {"a": 1}, [-1.0, 1e300], [math.nan] * 2),
]


_CANNOT_BE_TINY = re.compile("mass|radius|time|rate|norm|tolerance|stroke|speed|force")


class Hang(BaseException):
    """A case takes too long."""


@dataclass(frozen=True)
class Target:
    """A kind of input: how it is made, how it is damaged, how it is read.

    `read` returns numbers by name and bounds: what was accepted.
    """

    name: str
    make: Callable[[Path], None]
    damage: Callable[[np.random.Generator, Path], str]
    read: Callable[[Path], None]


def pick(rng, options):
    return options[int(rng.integers(len(options)))]


# ---------------------------------------------------------------- damage of any file


def damage_bytes(rng, path: Path) -> str:
    data = bytearray(path.read_bytes())
    how = pick(rng, ["flip", "cut", "double", "insert", "zero", "empty", "shuffle"])
    at = int(rng.integers(len(data))) if data else 0
    if how == "flip" and data:
        for place in rng.integers(len(data), size=int(rng.integers(1, 5))):
            data[place] ^= int(rng.integers(1, 256))
    elif how == "cut":
        del data[at:]
    elif how == "double":
        data = data * 2
    elif how == "insert":
        data[at:at] = bytes(rng.integers(256, size=9, dtype=np.uint8))
    elif how == "zero":
        data[at : at + 16] = bytes(len(data[at : at + 16]))
    elif how == "shuffle":
        data = data[at:] + data[:at]
    else:
        data = bytearray()
    path.write_bytes(data)
    return f"{path.name}: bytes {how}"


def damage_kind(rng, path: Path) -> str:
    """Puts something else in the place of a file."""
    how = pick(rng, ["missing", "folder", "fifo", "zero", "dangling", "loop", "null"])
    path.unlink()
    if how == "folder":
        path.mkdir()
    elif how == "fifo":
        os.mkfifo(path)
    elif how == "dangling":
        path.symlink_to("nowhere")
    elif how == "loop":
        path.symlink_to(path)
    elif how in ("zero", "null"):
        path.symlink_to(f"/dev/{how}")
    return f"{path.name}: {how}"


def places(value, path=()) -> Iterator[tuple]:
    """Every place of a JSON value, as the keys that lead there."""
    if isinstance(value, dict):
        for key in value:
            yield (*path, key)
            yield from places(value[key], (*path, key))
    elif isinstance(value, list):
        for index in range(min(len(value), 4)):
            yield (*path, index)
            yield from places(value[index], (*path, index))


def damage_json(rng, path: Path) -> str:
    value = json.loads(path.read_text())
    how = pick(rng, ["set", "set", "set", "set", "remove", "add", "deep", "wrap"])
    if how == "deep":
        text = pick(rng, ["[" * 100_000, '{"a":' * 5000, "[" * 400 + "]" * 400])
        path.write_text(text)
        return f"{path.name}: deep"
    if how == "wrap":
        path.write_text(json.dumps([value]))
        return f"{path.name}: wrapped"
    every = list(places(value))
    where = pick(rng, every) if every else None
    if where is None:
        return damage_bytes(rng, path)
    inner = value
    for key in where[:-1]:
        inner = inner[key]
    if how == "remove":
        del inner[where[-1]]
    elif how == "add" and isinstance(inner, dict):
        inner["a key of nobody"] = pick(rng, VALUES)
    elif how == "add":
        inner.append(pick(rng, VALUES))
    else:
        inner[where[-1]] = pick(rng, VALUES)
        how = f"set to {str(inner[where[-1]])[:20]!r}"
    path.write_text(json.dumps(value))
    if "seal" in value and rng.random() < 0.8:
        with contextlib.suppress(ValueError):  # NaN, or not Unicode
            write_sealed(path, value)
            how += ", seal fits"
    return f"{path.name}: {'.'.join(map(str, where))} {how}"


def damage_any(rng, path: Path) -> str:
    kinds = [damage_bytes, damage_kind]
    kinds += [damage_json] * 5 if path.suffix == ".json" else [damage_bytes]
    return pick(rng, kinds)(rng, path)


# ------------------------------------------------------------------------- datasets


def make_store(out: Path) -> None:
    config = GenerateConfig(
        **{"pushes": 6, "chunk_size": 4, "hold_steps": 12, "stroke_mm": (8.0,)}
    )
    generate(config, out)


def make_recorded(out: Path) -> None:
    """Pushes with unknown poses and velocities, groups and repeats."""
    make_store(out)
    store = open_store(out)
    arrays = store.read(slice(None))
    arrays["truth"][:, ::3] = np.nan
    arrays["truth"][..., 3:] = np.nan
    arrays["pose_observed"][:, ::3] = 0
    arrays["rate_observed"][:] = 0
    arrays["group"] = np.arange(6) % 2
    arrays["repeat"] = np.arange(6) // 2
    groups = ("felt", "ice")
    info = structs.replace(store.info, engine="recorded", groups=groups, seed=None)
    shutil.rmtree(out)
    write_store(out, structs.replace(info, has_repeats=True), arrays)


def rehash(store: Path) -> None:
    """Makes the list of hashes agree with whatever the files are now."""
    listing = store / "hashes.json"
    found = json.loads(listing.read_text())
    for name in found["files"]:
        path = store / "pushes.zarr" / name
        if path.is_file():
            found["files"][name] = content_hash(path.read_bytes())
    listing.write_text(json.dumps(found))


def damage_values(rng, out: Path) -> str:
    """Writes the same dataset with one impossible value."""
    store = open_store(out)
    arrays = store.read(slice(None))
    name = pick(rng, sorted(arrays))
    values = arrays[name]
    place = tuple(int(rng.integers(n)) for n in values.shape)
    whole = values.dtype.kind in "iu"
    limits = np.iinfo(values.dtype) if whole else None
    numbers = [0, 1, 7, 10**9, -1, limits.min, limits.max] if limits else [0.0, -1.0]
    numbers += [] if whole else [math.nan, math.inf, 1e30, -1e30, 1e-46, 500.0]
    value = pick(rng, numbers)
    values[place] = np.array(value).astype(values.dtype)
    shutil.rmtree(out)
    write_store(out, store.info, arrays)
    return f"{name}{list(place)} = {values[place]}"


def damage_store(rng, out: Path) -> str:
    how = int(rng.integers(4))
    if how == 0:
        return damage_values(rng, out)
    arrays = out / "pushes.zarr"
    documents = [out / "hashes.json", *sorted(arrays.rglob("zarr.json"))]
    chunks = [p for p in sorted(arrays.rglob("*")) if p.is_file() and p.suffix == ""]
    path = pick(rng, documents if rng.random() < 0.6 else chunks)
    said = damage_any(rng, path)
    if how > 1 and path.name != "hashes.json":
        rehash(out)
        said += ", hashes match"
    return said


def read_store(out: Path) -> None:
    store = open_store(out)
    arrays = store.read(slice(None))
    store.repeats()
    info = store.info
    expect(0 < info.time_step <= 0.1, "time_step", info.time_step)
    for name in ("mass", "radius", "pusher_radius"):
        expect(np.all((arrays[name] > 1e-5) & (arrays[name] < 1e3)), name, arrays[name])
    for name in ("table_friction", "disk_friction", "pusher_friction"):
        expect(np.all((arrays[name] >= 0) & (arrays[name] <= 10)), name, arrays[name])
    steps = arrays["steps"]
    expect(np.all((steps >= 1) & (steps <= info.steps)), "steps", steps)
    expect(np.all(arrays["group"] >= 0), "group", arrays["group"])
    for name, variable in variables(info).items():
        if variable.dtype is np.float32:
            big = np.nanmax(np.abs(arrays[name]), initial=0)
            expect(big <= 1e4, name, big)
    seen = (arrays["pose_observed"] > 0)[..., None, None]
    lost = np.isnan(arrays["truth"][..., :3]) & seen
    exists = np.arange(info.steps) < steps[:, None]
    expect(not (lost & exists[..., None, None]).any(), "truth", "NaN")


# ------------------------------------------------------------ networks and engines


def make_network(out: Path) -> None:
    shipped = TESTS.parent / "src/sainet/models/pretrained/sain"
    shutil.copytree(shipped, out, dirs_exist_ok=True)


def damage_network(rng, out: Path) -> str:
    card, weights = out / "card.json", out / "network.safetensors"
    if rng.random() < 0.6:
        return damage_any(rng, card)
    said = damage_any(rng, weights)
    if weights.is_file() and not weights.is_symlink() and rng.random() < 0.7:
        found = json.loads(card.read_text())
        found["weights"] = content_hash(weights.read_bytes())
        write_sealed(card, found)
        said += ", hash matches"
    return said


def read_model(out: Path) -> None:
    numbers_of(load_model(str(out)).id)
    if (out / "card.json").is_file():
        numbers_of(read_card(out))
    else:
        numbers_of(read_identified(out))


def make_identified(out: Path) -> None:
    internal = InternalEngine(PlanarSpec(), CameraOffset(x=0.001, y=0.002))
    estimate = Estimate("pusher_friction", 0.2, 0.1, 0.3, 0.25)
    errors = {"before_mm": 2.0, "after_mm": 1.0, "before_deg": 2.0, "after_deg": 1.0}
    found = Identified(engine=internal, estimates=(estimate,), pushes=9, **errors)
    write_document(out / "identified.json", found)
    write_json(out / "config.json", {"command": "identify"})


def damage_one(rng, out: Path) -> str:
    files = [path for path in sorted(out.rglob("*")) if path.is_file()]
    return damage_any(rng, pick(rng, files))


# ------------------------------------------------------------------ trials, reports


def make_control(out: Path) -> None:
    from report import samples

    write_json(out / "config.json", {"command": "control", "trials": 3})
    write_json(out / "manifest.json", {"versions": {"sainet": "0.1.0"}})
    names = [f"episodes/{trial:03d}.json" for trial in range(3)]
    for trial, name in enumerate(names):
        write_sealed(out / name, samples.record_json(trial=trial))
    write_sealed(out / "episodes.json", {"episodes": names})


def read_report(out: Path) -> None:
    from sainet.studies.run_report import page_of

    page_of(out)


def read_episode(out: Path) -> None:
    from sainet.control.record import read_record

    for path in sorted((out / "episodes").glob("*.json")):
        found = read_record(path)
        numbers_of(msgspec.to_builtins(found))
        end = math.inf if found.final_mm is None else found.final_mm
        reached = end < found.tolerance_mm + 0.1
        expect(reached or not found.solved, "solved", f"true at {end} mm")


# --------------------------------------------------------------------------- tables


def make_table(out: Path) -> None:
    from datasets import own_pushes

    rows = own_pushes.rows(rate=50.0, duration=0.2) + own_pushes.rows("2", 50.0, 0.2)
    own_pushes.write(out, own_pushes.to_csv(rows))


CELLS = [
    *("", "nan", "inf", "-1", "0", "1e300", "1e-46", "1e30", "50", "x", "1,2", '"'),
    *(
        "\u0661\u0662",
        "\uff11",
        "\x00",
        "x" * 5000,
        "-0",
        "1e400",
        "=1+1",
        "0x10",
        "\n",
    ),
]


def damage_table(rng, out: Path) -> str:
    path = pick(rng, [out / "pushes.csv", out / "bodies.toml"])
    if rng.random() < 0.3:
        return damage_any(rng, path)
    lines = path.read_text().splitlines()
    row = int(rng.integers(len(lines)))
    new = pick(rng, CELLS)
    if path.suffix == ".toml":
        lines[row] = re.sub(r"= .*", lambda _: f"= {new}", lines[row])
    else:
        cells = lines[row].split(",")
        cells[int(rng.integers(len(cells)))] = new
        lines[row] = ",".join(cells)
    path.write_text("\n".join(lines), errors="surrogatepass")
    return f"{path.name}: line {row + 1} has {new[:9]!r}"


def read_table(out: Path) -> None:
    def keep(folder, settings, pushes, properties):
        numbers_of(properties)
        for push in pushes:
            path = [push.motion, push.pusher, push.initial]
            biggest = max(np.nanmax(np.abs(each), initial=0) for each in path)
            expect(biggest <= 1e4, "motion", biggest)

    # Reading is what is tested; simulating would compile for every length.
    with mock.patch.object(own, "import_pushes", keep):
        own.import_table(out / "pushes.csv", out / "bodies.toml", out / "store")


# -------------------------------------------------------------------------- options

WORDS = {
    "generate robot --out OUT": [
        *(
            "pushes",
            "disks",
            "seed",
            "mass-kg",
            "radius-mm",
            "table-friction",
            "engine",
        ),
        *("pusher-radius-mm", "contact-angle-deg", "gap-mm", "stroke-mm"),
        *(
            "engine",
            "hold-steps",
            "tracking-mm",
            "correlation-time",
            "chunk-size",
            "force-n",
        ),
        *(
            "speed-mm-s",
            "assumed-engine",
            "noise-level",
            "capture-deg",
            "friction-length-mm",
        ),
    ],
    "control --out OUT": [
        *("trials", "pushes", "seed", "tolerance", "alignment", "deadline", "disks"),
        *("goals", "noise-level"),
    ],
    "train sain --data DATA --out OUT": [
        *("iterations", "batch-size", "learning-rate", "l2", "seed", "halve-every"),
        *("clip-norm", "steps"),
    ],
}
GIVEN = [
    *("-1", "0", "nan", "inf", "-inf", "1e300", "1e-46", "1e30", "1e-30", "10" * 200),
    *(
        "",
        "x",
        "\ud800",
        "1000000",
        "2147483648",
        "1e5",
        "0.5",
        "planer",
        "none",
        "a\nb",
    ),
]


def make_options(out: Path) -> None:
    (out / "words.json").write_text(json.dumps(next(iter(WORDS)).split()))


def damage_options(rng, out: Path) -> str:
    command = pick(rng, list(WORDS))
    option, value = pick(rng, WORDS[command]), pick(rng, GIVEN)
    words = [*command.split(), f"--{option}={value}"]
    (out / "words.json").write_text(json.dumps(words))
    return " ".join(words)[:90]


def read_options(out: Path) -> None:
    words = json.loads((out / "words.json").read_text())
    with contextlib.redirect_stderr(io.StringIO()) as shown:
        try:
            command = parse(words)
        except SystemExit as ended:
            expect(ended.code == 2, "exit status", ended.code)
            expect("Traceback" not in shown.getvalue(), "stderr", shown.getvalue())
            return
    if hasattr(command, "config"):
        numbers_of(command.config)


SETTINGS = {"command": "fuzz", "seed": 0, "size": [1.0, 2.0]}


def make_folder(out: Path) -> None:
    open_run(out, SETTINGS, finished_by="end.json")


def read_folder(out: Path) -> None:
    open_run(out, SETTINGS, finished_by="end.json")


TARGETS = [
    Target("dataset", make_store, damage_store, read_store),
    Target("recorded", make_recorded, damage_store, read_store),
    Target("folder", make_folder, damage_one, read_folder),
    Target("network", make_network, damage_network, read_model),
    Target("identified", make_identified, damage_one, read_model),
    Target("episodes", make_control, damage_one, read_episode),
    Target("report", make_control, damage_one, read_report),
    Target("report-network", make_network, damage_one, read_report),
    Target("table", make_table, damage_table, read_table),
    Target("options", make_options, damage_options, read_options),
]


# ------------------------------------------------------------------------- verdicts


class Accepted(AssertionError):
    """An impossible value was accepted."""


def expect(good, name: str, value) -> None:
    if not good:
        raise Accepted(f"{name} is {str(value)[:60]}")


def numbers_of(value, name: str = "") -> None:
    """Raises `Accepted` for a number that no float in single precision can hold."""
    if name in ("config", "manifest", "deadline"):  # never in single precision
        return
    if is_dataclass(value):
        for field in fields(value):
            numbers_of(getattr(value, field.name), field.name)
    elif hasattr(value, "__struct_fields__"):
        for field in value.__struct_fields__:
            numbers_of(getattr(value, field), field)
    elif isinstance(value, dict):
        for key, each in value.items():
            numbers_of(each, str(key))
    elif isinstance(value, list | tuple):
        for each in value:
            numbers_of(each, name)
    elif isinstance(value, float):
        expect(math.isfinite(value) and abs(value) < 1e30, name, value)
        tiny = _CANNOT_BE_TINY.search(name) and 0 < abs(value) < 1e-30
        expect(not tiny, name, value)


def verdict(target: Target, folder: Path) -> tuple[str, str]:
    """Returns "refused" or "accepted", or what is wrong, and the words of it."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.setitimer(signal.ITIMER_REAL, SLOWEST)
    try:
        target.read(folder)
        found = "accepted", ""
    except SainetError as error:
        text = message(error)
        lines = str(error).splitlines()
        longest = max(map(len, lines)) - 3 * len(str(folder))
        good = all(map(str.isprintable, text.splitlines())) and longest <= LONGEST
        # Only tables list several problems.
        good = good and (len(lines) == 1 or target.name == "table")
        found = ("refused", text) if good else ("LONG", str(error)[:400])
    except Accepted as error:
        found = "IMPOSSIBLE", str(error)
    except Hang:
        found = "HANG", f"over {SLOWEST} s"
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        words = f"{type(error).__name__}: {str(error)[:120]!r}"
        found = "TRACEBACK", f"{words} at {Path(where.filename).name}:{where.lineno}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    return found if grown < MOST_MEMORY else ("MEMORY", f"{grown} kB more")


def on_alarm(number, frame) -> None:
    raise Hang


def run(cases: range, seed: int, *, show: bool = False, names=()) -> Counter:
    """Runs cases; returns how many ended how, by target and verdict."""
    counts: Counter = Counter()
    signal.signal(signal.SIGALRM, on_alarm)
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_DATA, MOST_DATA))
    targets = [t for t in TARGETS if not names or t.name in names]
    with tempfile.TemporaryDirectory() as temporary:
        home = Path(temporary)
        for case in cases:
            target = targets[case % len(targets)]
            source, folder = home / "real" / target.name, home / f"case-{case}"
            if not source.exists():
                source.mkdir(parents=True)
                target.make(source)
                check_real(target, source, home / "undamaged")
            shutil.copytree(source, folder)
            rng = np.random.default_rng([seed, case])
            said = target.damage(rng, folder)
            how, words = verdict(target, folder)
            counts[target.name, how] += 1
            if show or how.isupper():
                print(f"case {case} {target.name}: {how}: {said}: {words}", flush=True)
            shutil.rmtree(folder)
    return counts


def check_real(target: Target, source: Path, copy: Path) -> None:
    """Raises unless the undamaged input is accepted: else every case would pass."""
    shutil.copytree(source, copy)
    how, words = verdict(target, copy)
    if how != "accepted":
        raise SystemExit(f"{target.name}: the undamaged input is {how}: {words}")
    shutil.rmtree(copy)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--case", type=int, help="run this case only and show it")
    parser.add_argument("--target", nargs="*", default=(), help="of these kinds only")
    parser.add_argument("--show", action="store_true", help="show every case")
    given = parser.parse_args()
    one = given.case
    cases = range(given.cases) if one is None else range(one, one + 1)
    start = time.perf_counter()
    show = given.show or one is not None
    counts = run(cases, given.seed, show=show, names=given.target)
    took = time.perf_counter() - start
    for (name, how), count in sorted(counts.items()):
        print(f"{name:16} {how:10} {count}")
    wrong = sum(count for (_, how), count in counts.items() if how.isupper())
    print(f"{sum(counts.values())} cases in {took:.0f} s, {wrong} failed")
    raise SystemExit(wrong > 0)


if __name__ == "__main__":
    main()
