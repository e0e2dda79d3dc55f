"""Stored pushes, simulated or recorded: how they are made, kept and read."""

from typing import Literal

# Divisions into folds, see `datasets.folds`.
Scheme = Literal["kind", "chain", "place", "direction", "side", "order"]
