"""Warnings of models that were fitted to pushes unlike those that they predict."""

from collections.abc import Iterable, Iterator, Sequence

from sainet.datasets.groups import groups_of
from sainet.datasets.store import Store
from sainet.engines import RECORDED
from sainet.models.model import Model


def unlike_pushes(models: Sequence[Model], store: Store) -> Iterator[str]:
    """Yield warnings of models that were fitted in another world, or to other groups.

    Args:
        models: those without a card are skipped, as are groups that no card names.
        store: the test pushes.
    """
    yield from other_worlds(models, store.info.engine)
    yield from other_groups(models, groups_of([store]))


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
