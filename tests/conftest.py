"""Sets JAX up as strictly as it goes, and finds what only some machines have.

Order matters here: the device count has to be set before the first array exists, and
the import hook before the first import of `sainet`. Warnings become errors in
pyproject.toml.
"""

import gc
import os
import shutil
import signal
import sys
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

# Shells start background jobs with Ctrl-C ignored; tests press it in what they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Before the first import of numpy. The threads of OpenBLAS wait in a loop: with two
# workers on two cores, small products of matrices take three times the processor time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import pytest
from jaxtyping import install_import_hook

import checks
import lowering
from support import REPOSITORY, require

# The workers of a run and the commands that they start compile the same things; what
# one has compiled, no other has to. Set for those commands too, hence the environment.
CACHE = {
    "jax_compilation_cache_dir": str(REPOSITORY / ".pytest_cache" / "jax"),
    "jax_persistent_cache_min_compile_time_secs": "0",  # most programs take 20 ms
}
for name, value in CACHE.items():
    os.environ[name.upper()] = value
# Most of a test is compilation: no optimisation, XLA's older emitters, which compile in
# half the time and run slower, and undivided programs, a quarter less again. XLA_FLAGS
# in the environment takes precedence: with XLA_FLAGS= the tests run the code that users
# run, to the last bit; CI does that for the engines, the networks and the search.
QUICK = (
    "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false "
    "--xla_cpu_parallel_codegen_split_count=1"
)
os.environ.setdefault("XLA_FLAGS", QUICK)
jax.config.update("jax_compilation_cache_dir", CACHE["jax_compilation_cache_dir"])
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
jax.config.update("jax_traceback_in_locations_limit", 0)  # none in compiled code
jax.config.update("jax_num_cpu_devices", 2)
jax.config.update("jax_numpy_rank_promotion", "raise")

# While the hook imports a module it finds no compiled code: what is imported before, it
# does not compile from source, which takes seconds in every worker.
HEAVY = (
    *("equinox", "matplotlib.backends.backend_agg", "matplotlib.pyplot", "optax"),
    *("pyarrow.parquet", "rich.progress", "scipy.io", "scipy.optimize"),
    *("scipy.signal", "scipy.stats", "tyro", "xarray", "zarr"),
)
for name in HEAVY:
    if find_spec(name.partition(".")[0]):
        import_module(name)
# What the hook and pytest compile from source is kept where it disturbs nobody, also if
# the environment forbids bytecode: half of the time of collecting, in every worker.
sys.dont_write_bytecode = False
sys.pycache_prefix = str(REPOSITORY / ".pytest_cache" / "bytecode")
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix  # of commands and workers
# Annotated shapes and types of the package are checked while the tests run.
checks.install()
lowering.install()
install_import_hook("sainet", "support.typechecker")


class Chromium(NamedTuple):
    """Where Chromium and its driver are."""

    browser: Path
    driver: Path


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Start the slow tests first, so that no worker finishes long after the others."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


def pytest_collection_finish() -> None:
    """Exempt what is imported by now from garbage collection: a tenth of all time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 50, 100)


def pytest_runtest_setup() -> None:
    """Check the first calls of every function in each test."""
    checks.begin_test()


@pytest.fixture(scope="module", autouse=True)
def few_compiled_programs() -> Iterator[None]:
    """Forget compiled programs before the system has no room for their memory maps.

    The tests of a module share them.
    """
    yield
    import_module("sainet.runs.programs").make_room()


@pytest.fixture(scope="session")
def recorded_pushes_folder() -> Path:
    """The folder of recorded pushes: $SAINET_DATA/mitpush or ../shared/data/mitpush."""
    named = os.environ.get("SAINET_DATA")
    folder = Path(named) if named else REPOSITORY.parent / "shared" / "data"
    folder /= "mitpush"
    require(
        (folder / "ellip1_endpoints.csv").is_file(),
        f"{folder} has no recorded pushes. They are not shipped: they come from the "
        "evaluation logs in the public repository robinzhoucmu/Pushing, folder "
        "mcube_data_proc/motion_model_eval_logs. Set SAINET_DATA to the folder "
        "that holds mitpush/.",
    )
    return folder


@pytest.fixture(scope="session")
def chromium() -> Chromium:
    """Chromium and its driver, as Debian's packages install them."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    driver = shutil.which("chromedriver")
    require(
        browser and driver,
        "Chromium or its driver is missing: apt-get install chromium chromium-driver",
    )
    return Chromium(Path(str(browser)), Path(str(driver)))
