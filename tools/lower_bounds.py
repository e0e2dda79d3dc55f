"""Prints the lower bound of every base dependency as an exact pin, for pip's `-c`.

The bounds stand once, in pyproject.toml; `make lower-bounds` installs what this prints
and runs the suite, so that a bound is a version somebody has seen working.
"""

import re
import sys
import tomllib
from pathlib import Path

BOUND = re.compile(r"(?P<name>[A-Za-z0-9._-]+)>=(?P<version>[0-9.]+)")


def pin(requirement: str) -> str:
    """Turns `jax>=0.8.0` into `jax==0.8.0`; anything else is an error, not a guess."""
    bound = BOUND.fullmatch(requirement)
    if bound is None:
        sys.exit(f"pyproject.toml: {requirement!r} is not of the form name>=version.")
    return f"{bound['name']}=={bound['version']}"


def main() -> None:
    """Prints one pin a line."""
    pyproject = Path(__file__).parent.parent / "pyproject.toml"
    project = tomllib.loads(pyproject.read_text())["project"]
    print("\n".join(pin(requirement) for requirement in project["dependencies"]))


if __name__ == "__main__":
    main()
