"""Models that abstain, in scripts."""

from collections.abc import Iterator, Mapping, Sequence

from sainet.api.models import Loadable, load
from sainet.evaluation import abstention
from sainet.evaluation.abstention import Abstaining
from sainet.models.model import Model

Row = Loadable | Abstaining
Models = Mapping[str, Row] | Sequence[Row]


def abstaining(model: Loadable, *, engine: Loadable = "physics") -> Abstaining:
    """Return a model that abstains on surfaces that it was not fitted to.

    There the engine predicts instead, as if nothing had been fitted. The name of the
    group of a push decides: its surface is the part before the speed, ``abs`` of
    ``abs-10``. Another speed on a known surface is no reason to abstain. Nothing in the
    measured motion is used: a push with a wrong name has the wrong prediction.

    `evaluate` takes the result beside other models. Where it abstains it has no
    regions. Its method ``on(surface)`` returns the model that predicts pushes of a
    surface.

    Args:
        model: fitted to recorded pushes, as `load` takes it.
        engine: predicts on other surfaces, as `load` takes it; by default the planar
            engine with assumed properties.

    Raises:
        BadInput: the model does not name the groups that it was fitted to.
    """
    return abstention.abstaining([load(model)], load(engine))[0]


def rows_of(models: Models) -> Iterator[Model | Abstaining]:
    """Return the rows of a table, with the names that a user gives them."""
    if isinstance(models, Mapping):
        return (_row(model).called(name) for name, model in models.items())
    return map(_row, models)


def _row(model: Row) -> Model | Abstaining:
    return model if isinstance(model, Abstaining) else load(model)
