"""What tests of several folders share: `from support import require`."""

import os
from collections.abc import Mapping
from pathlib import Path

import pytest
from beartype import BeartypeConf, beartype

from sainet.runs.documents import content_hash, to_json

REPOSITORY = Path(__file__).resolve().parent.parent
SOURCE = REPOSITORY / "src" / "sainet"

# As pyright reads annotations: an int passes where a float is asked for (PEP 484).
typechecker = beartype(conf=BeartypeConf(is_pep484_tower=True))


def write_sealed(path: Path, fields: Mapping[str, object]) -> None:
    """Write a JSON document whose seal fits, whatever its fields are."""
    others = {name: value for name, value in fields.items() if name != "seal"}
    seal = content_hash(to_json(others).encode())
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(to_json(others | {"seal": seal}))


def require(condition: object, reason: str) -> None:
    """Skip the test, with the reason, if the machine lacks a requirement.

    With SAINET_REQUIRE_ALL=1 it fails instead, so that a run which installed everything
    cannot pass by testing nothing.
    """
    if condition:
        return
    if os.environ.get("SAINET_REQUIRE_ALL") == "1":
        pytest.fail(f"SAINET_REQUIRE_ALL=1 and {reason}", pytrace=False)
    pytest.skip(reason)
