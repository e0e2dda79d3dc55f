"""Warnings of models that were fitted to pushes unlike those that they predict."""

from collections.abc import Iterable, Iterator, Sequence

from sainet.datasets.groups import groups_of
from sainet.datasets.store import Store
from sainet.engines import RECORDED
from sainet.models.card import Card
from sainet.models.model import Model
from sainet.models.process_card import ProcessCard

# With fewer training pushes the errors of networks rise steeply: they double from 150
# to 50 simulated pushes (`sainet reproduce data-efficiency`).
_FEW_PUSHES = 150


def unlike_pushes(models: Sequence[Model], store: Store) -> Iterator[str]:
    """Yield warnings of models fitted to other worlds, groups or numbers of disks.

    Args:
        models: those without a card are skipped, as are groups that no card names.
        store: the test pushes.
    """
    yield from other_worlds(models, store.info.engine)
    yield from other_groups(models, groups_of([store]))
    yield from other_numbers(models, store.info.bodies)


def other_numbers(models: Iterable[Model], disks: int) -> Iterator[str]:
    """Yield warnings of networks that were trained on other numbers of disks.

    Args:
        models: those that take one number only are skipped: others are refused.
        disks: in each test push.
    """
    for model in models:
        made_for = model.dynamics.made_for
        if made_for is not None and made_for.disks is None:
            for doubt in doubts_of_count(model.card, disks):
                yield f"{model.name}: {doubt}."


def other_worlds(models: Iterable[Model], truth_engine: str) -> Iterator[str]:
    """Yield warnings of networks that were trained on pushes of another world.

    Args:
        models: those without a network are skipped.
        truth_engine: engine that made the test pushes, or `RECORDED`.
    """
    trained: dict[str, list[str]] = {}
    for model in models:
        if model.card and model.card.truth_engine != truth_engine:
            trained.setdefault(model.card.truth_engine, []).append(model.name)
    for engine, names in trained.items():
        yield (
            f"{', '.join(names)}: trained on {_pushes_of(engine)}, but these are "
            f"{_pushes_of(truth_engine)}. Expect larger errors; 'sainet tune' adapts a "
            "network to other pushes."
        )


def _pushes_of(engine: str) -> str:
    is_recorded = engine == RECORDED
    return "recorded pushes" if is_recorded else f"pushes simulated by {engine}"


def other_groups(models: Iterable[Model], groups: Sequence[str]) -> Iterator[str]:
    """Yield warnings of models that were fitted to other groups of recorded pushes.

    Args:
        models: those whose groups are not known are skipped.
        groups: of the test pushes.
    """
    for model in models:
        known = model.groups if model.card else ()
        if known and (others := sorted(set(groups) - set(known))):
            yield (
                f"{model.name}: fitted to pushes of {', '.join(known)}, but these are "
                f"of {', '.join(others)}. On another surface it can err more than the "
                "engine with assumed properties, and its 90 % regions hold fewer "
                "ends; 'sainet tune' adapts it."
            )


def doubts_of_training(card: Card | ProcessCard | None, disks: int) -> Iterator[str]:
    """Yield reasons why plans with a network may fail, from its training data.

    Args:
        card: of the trained model; None without one.
        disks: in the scene to plan in.
    """
    if card is None:
        return
    if card.trained_pushes < _FEW_PUSHES:
        yield (
            f"its {card.noun} was trained on {card.trained_pushes} pushes; give it at "
            f"least {_FEW_PUSHES}"
        )
    yield from doubts_of_count(card, disks)


def doubts_of_count(card: Card | ProcessCard | None, disks: int) -> Iterator[str]:
    """Yield a reason why predictions may fail: fewer disks than in training, or more.

    Args:
        card: of the trained model; None without one.
        disks: in the scene.
    """
    if card is None:
        return
    trained = card.numbers_of_disks
    if not trained[0] <= disks <= trained[-1]:
        known = " to ".join(map(str, sorted({trained[0], trained[-1]})))
        yield (
            f"its {card.noun} was trained on pushes of {known} disk(s) and may predict "
            f"this scene of {disks} badly; train one on such pushes"
        )
