"""What a trained model is, in sentences that a reader understands."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from sainet.engines import RECORDED
from sainet.learning.log import LogLine, read_log
from sainet.models.card import CARD, Card, read_card
from sainet.models.ensemble_card import EnsembleCard, is_ensemble, load_ensemble
from sainet.models.process_card import ProcessCard, is_process, read_process_card

_SETUPS = {
    "robot": "a pusher that follows a path",
    "direct-force": "a pusher that a force drives",
}
_REGIONS = (
    "It states in which region a push ends with a probability of 90 %. Each push that "
    "sets the sizes of the regions was left out of the fit that predicts it; 'sainet "
    "evaluate' shows whether the regions hold on other pushes."
)


def read_any_card(folder: Path) -> Card | ProcessCard | None:
    """Return the card of the trained model in a folder; None where there is none.

    Raises:
        BadCheckpoint: it is damaged.
    """
    if is_process(folder):
        return read_process_card(folder)
    if is_ensemble(folder):
        return load_ensemble(folder)[1]
    return read_card(folder) if (folder / CARD).is_file() else None


def sentences_of(folder: Path) -> list[str]:
    """Return what the trained model in a folder is; nothing where there is none."""
    if is_ensemble(folder):
        return [*of_ensemble(*load_ensemble(folder)[1:], folder)]
    card = read_any_card(folder)
    if isinstance(card, ProcessCard):
        return [*of_process(card, folder)]
    return [*of_network(card, read_log(folder), folder)] if card else []


def of_network(card: Card, history: Sequence[LogLine], folder: Path) -> Iterator[str]:
    """Yield what a network is, how its training went, and what to do next."""
    yield _made_of(card)
    if len(history) > 1:
        first, last = history[0], history[-1]
        factor = first.loss / last.loss if last.loss else 0.0
        sentence = (
            f"Training took {last.iteration:,} iterations. The loss was "
            f"{first.loss:.3g} at iteration {first.iteration}, and is "
            f"{last.loss:.3g} now"
        )
        more = f", {factor:.1f} times less." if factor >= 1 else ": it did not fall."
        yield sentence + more
    yield _purpose(card, folder)


def of_process(card: ProcessCard, folder: Path) -> Iterator[str]:
    """Yield what a Gaussian process is, and what to do next."""
    yield _made_of(card)
    words = ", ".join(name.replace("_", " ") for name in card.inputs)
    yield f"Its inputs at the start of a push are: {words}."
    yield _REGIONS
    yield _purpose(card, folder)


def of_ensemble(card: Card, found: EnsembleCard, folder: Path) -> Iterator[str]:
    """Yield what an ensemble is, and what to do next."""
    yield _made_of(card)
    yield (
        f"It is the mean of {len(found.members)} networks, whose training differs in "
        "its seed only."
    )
    yield _REGIONS
    yield _purpose(card, folder)


def _made_of(card: Card | ProcessCard) -> str:
    origin = (
        "recorded pushes"
        if card.truth_engine == RECORDED
        else f"pushes that the engine {card.truth_engine} simulated"
    )
    fewest, most = card.numbers_of_disks[0], card.numbers_of_disks[-1]
    disks = f"{fewest} to {most} disks" if fewest < most else f"{most} disk"
    disks += "s" if 1 < fewest == most else ""
    label = card.identity.label
    return f"{label}, from {card.trained_pushes:,} {origin}, of {disks}."


def _purpose(card: Card | ProcessCard, folder: Path) -> str:
    return (
        f"It predicts pushes by {_SETUPS[card.kind]}, in steps of "
        f"{1000 * card.time_step:.3g} ms. 'sainet evaluate' shows whether it is better "
        "than the engine alone: compare physics, physics-true and "
        f"{folder} on pushes that it was not trained on."
    )
