"""Manifests: versions, commit and hardware of a run."""

import os
import platform
import subprocess
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import Any

from sainet.runs.documents import FORMAT_VERSION


MANIFEST = "manifest.json"


def manifest(devices: int = 0) -> dict[str, Any]:
    """Return versions, commit and hardware, without dates."""
    names = ("sainet", "jax", "jaxlib", "equinox", "optax", "numpy", "scipy", "zarr")
    return {
        "format_version": FORMAT_VERSION,
        "versions": {name: _version(name) for name in (*names, "pybullet")},
        "git_commit": _git_commit(),
        "python": platform.python_version(),
        "machine": platform.machine(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "devices": devices,
    }


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
