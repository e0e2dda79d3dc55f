"""A model with its name, and what its network may be used for."""

from dataclasses import dataclass
from pathlib import Path

from sainet.models.card import CARD, Card
from sainet.models.dynamics import AbstractDynamics
from sainet.runs.errors import BadCheckpoint

_SAME_TIME = 1e-9  # s


@dataclass(frozen=True)
class NamedDynamics:
    """A model, what to call it in tables, and the card of its network if any."""

    name: str
    dynamics: AbstractDynamics
    card: Card | None = None
    folder: Path | None = None  # of what was trained or identified

    def check_fits(
        self,
        kind: str,
        time_step: float,
        *,
        seed: int | None = None,
        data: str | None = None,
    ) -> None:
        """Raise `BadCheckpoint` if the network is not for these pushes.

        Args:
            kind: of the pushes.
            time_step: s, of the pushes.
            seed: of simulated pushes that are to test the network; None otherwise.
            data: hash of the pushes that are to test the network, if any are.
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
                f"{path}: data_seed is {seed} (its own, or that of the network which "
                "it started from), and so is the seed of the data: the network may "
                "have been trained on these very pushes. Generate others with another "
                "`seed`, or give `force`."
            )
        if data is not None and data == self.card.data:
            raise BadCheckpoint(
                f"{path}: data is {data[:12]}..., and so are these pushes: the network "
                "was trained on them. Test it on others, or give `force`."
            )
