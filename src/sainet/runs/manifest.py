"""Manifests of runs: versions, commit and hardware."""

import os
import platform
import subprocess
import sys
from contextlib import suppress
from importlib import metadata
from pathlib import Path

import msgspec

from sainet.runs.documents import content_hash

MANIFEST = "manifest.json"
_PACKAGES = (
    *("sainet", "jax", "jaxlib", "equinox", "optax", "numpy", "scipy", "zarr"),
    "mujoco-core",
    "pybullet",
)


class Manifest(msgspec.Struct, frozen=True, kw_only=True):
    """Versions, commit and hardware of a run; no dates, so that runs compare equal."""

    versions: dict[str, str | None]
    git_commit: str | None
    python: str
    machine: str
    processor: str
    cores: int | None
    devices: int
    gpu: str | msgspec.UnsetType = msgspec.UNSET  # its name, if JAX computed on one
    format_version: int = 2


def manifest(devices: int = 0) -> Manifest:
    """Return the manifest of a run on this machine.

    Args:
        devices: of JAX, where the result depends on their number.
    """
    return Manifest(
        versions=_versions(),
        git_commit=_git_commit(),
        python=platform.python_version(),
        machine=platform.machine(),
        processor=processor(),
        cores=os.cpu_count(),
        devices=devices,
        gpu=_gpu(),
    )


def _gpu() -> str | msgspec.UnsetType:
    """Return the name of the GPU of this process; asks only JAX that is imported."""
    jax = sys.modules.get("jax")
    if jax is None or jax.default_backend() != "gpu":
        return msgspec.UNSET
    return str(jax.devices()[0].device_kind)


def code_versions() -> dict[str, str | None]:
    """Return what results may depend on: versions of packages, and the commit."""
    return {**_versions(), "git_commit": _git_commit()}


def _versions() -> dict[str, str | None]:
    return {name: _version(name) for name in _PACKAGES}


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _git_commit() -> str | None:
    """Return the commit of this checkout; None for an installed package."""
    here = Path(__file__).resolve().parent
    command = ["git", "-C", str(here), "ls-files", "--error-unmatch", "manifest.py"]
    try:
        tracked = subprocess.run(command, capture_output=True, check=False, timeout=10)
        if tracked.returncode:
            return None
        command = ["git", "-C", str(here), "rev-parse", "HEAD"]
        done = subprocess.run(command, capture_output=True, check=False, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.decode().strip() or None


def processor() -> str:
    """Return the name of the processor of this machine."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor()


WORTH_KEEPING = 0.5  # s of compilation


def cache_folder() -> Path:
    """Return where compiled code is kept: ``$XDG_CACHE_HOME/sainet`` or ~/.cache.

    A folder for each processor: code that was compiled for one may not run on another
    that shares the home folder.
    """
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    machine = f"{processor()} {platform.machine()}"
    return Path(home) / "sainet" / content_hash(machine.encode())[:12]


def use_cache() -> None:
    """Keep what JAX compiles, for this process and those it starts.

    JAX's own variables take precedence.
    """
    settings = {
        "JAX_COMPILATION_CACHE_DIR": str(cache_folder()),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": str(WORTH_KEEPING),
    }
    for name, value in settings.items():
        os.environ.setdefault(name, value)
