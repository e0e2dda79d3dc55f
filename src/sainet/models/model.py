"""A model with its identity, and what its network may be used for."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt64

from sainet.models.card import CARD, Card
from sainet.models.dynamics import AbstractDynamics
from sainet.models.identity import ModelId
from sainet.runs.digests import pushes_overlap
from sainet.runs.errors import BadCheckpoint

_SAME_TIME = 1e-9  # s


@dataclass(frozen=True)
class Model:
    """A dynamics model, its identity, and the card of its network if it has one."""

    id: ModelId
    dynamics: AbstractDynamics
    card: Card | None = None
    folder: Path | None = None  # of a trained network or identified parameters
    digest: str | None = None  # hash of the weights or the identified parameters

    @property
    def name(self) -> str:
        """The name in tables and JSON."""
        return self.id.slug

    def check_fits(
        self,
        kind: str,
        time_step: float,
        *,
        seed: int | None = None,
        pushes: UInt64[np.ndarray, " push"] | None = None,
    ) -> None:
        """Raise `BadCheckpoint` if the network is not for these pushes.

        Args:
            kind: setup of the pushes.
            time_step: of the pushes (s).
            seed: of simulated test pushes; None otherwise.
            pushes: hashes of recorded test pushes (`Store.push_hashes`), if any.
        """
        if self.card is None:
            return
        path = f"{self.folder}/{CARD}"
        if self.card.kind != kind:
            raise BadCheckpoint(
                f"{path}: kind is {self.card.kind!r}, the data's is "
                f"{kind!r}; train a network on such pushes, or give `force`."
            )
        if abs(self.card.time_step - time_step) > _SAME_TIME:
            raise BadCheckpoint(
                f"{path}: time_step is {self.card.time_step} s, the data's is "
                f"{time_step} s; train a network on such data, or give `force`."
            )
        if seed is not None and seed in self.card.data_seeds:
            raise BadCheckpoint(
                f"{path}: data_seeds has {seed}, the seed of the data: the network may "
                "have been trained on these very pushes. Generate others with another "
                "`seed`, or give `force`."
            )
        seen = 0 if pushes is None else pushes_overlap(self.card.pushes, pushes)
        if pushes is not None and seen:
            raise BadCheckpoint(
                f"{path}: the network was trained on {seen} of these {len(pushes)} "
                "pushes. Test it on others ('sainet split'), or give `force`."
            )
