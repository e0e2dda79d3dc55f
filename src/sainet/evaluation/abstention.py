"""Models that abstain: on surfaces of no push of their fit, an engine predicts.

The name of the group of a push decides (`datasets.groups`); its motion does not.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs
from xarray import DataArray

from sainet.datasets.groups import surface_of
from sainet.datasets.store import Store
from sainet.evaluation.claims import Rule, Verdict, compared
from sainet.evaluation.joining import add_models
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.metrics import METRICS
from sainet.evaluation.summary import BASELINE, Comparison, Summary
from sainet.models.identity import ModelId
from sainet.models.model import Model
from sainet.runs.errors import BadInput


@dataclass(frozen=True)
class Abstaining:
    """A fitted model, and the engine that predicts where the model abstains.

    Attributes:
        fitted: predicts pushes of the surfaces that it was fitted to.
        engine: predicts all other pushes, with assumed properties.
        id: of both together.
    """

    fitted: Model
    engine: Model
    id: ModelId

    @property
    def name(self) -> str:
        """The name in tables and JSON."""
        return self.id.slug

    @property
    def surfaces(self) -> tuple[str, ...]:
        """The surfaces that the model was fitted to."""
        return tuple(dict.fromkeys(map(surface_of, self.fitted.groups)))

    def called(self, name: str) -> "Abstaining":
        """Return the same under another name in tables and JSON."""
        return replace(self, id=structs.replace(self.id, name=name))

    def on(self, surface: str) -> Model:
        """Return the model that predicts pushes of a surface, or of a group."""
        return self.fitted if surface_of(surface) in self.surfaces else self.engine


def with_abstaining(models: Sequence[Model]) -> list[Model | Abstaining]:
    """Return models, and the abstaining form of each that names its groups.

    Args:
        models: with physics, which predicts where the others abstain.

    Raises:
        BadInput: none names its groups.
    """
    engine = {model.name: model for model in models}[BASELINE]
    return [*models, *abstaining(models, engine)]


def abstaining(models: Sequence[Model], engine: Model) -> list[Abstaining]:
    """Return the abstaining forms of those models that name their groups.

    Args:
        models: fitted to recorded pushes.
        engine: predicts where they abstain.

    Raises:
        BadInput: none names its groups.
    """
    if found := [Abstaining(m, engine, m.id.abstaining) for m in models if m.groups]:
        return found
    raise BadInput(
        f"{', '.join(model.name for model in models)}: not known to be fitted to any "
        "surface, and cannot abstain on others; fit a model to recorded pushes whose "
        "groups have names ('sainet tune', 'sainet identify')."
    )


def measure(
    models: Sequence[Model | Abstaining],
    store: Store,
    run: Callable[[list[Model]], Measurements],
) -> Measurements:
    """Return the errors of models, some of which may abstain; each predicts once.

    Where a model abstains, its measurements are those of the engine, which has no
    regions.

    Args:
        models: in the order of the rows.
        store: the pushes.
        run: evaluates models on these pushes.

    Raises:
        BadInput: two models have the same name, or the pushes have no groups.
    """
    forms = [each for each in models if isinstance(each, Abstaining)]
    plain = [each for each in models if isinstance(each, Model)]
    if not forms:
        return run(plain)
    names = [model.name for model in models]
    if len(set(names)) < len(names):
        every = ", ".join(names)
        raise BadInput(f"`model`: {every} are not all different; rename one.")
    if not store.info.groups:
        raise BadInput(
            f"{store.path}: its pushes name no group, so that their surface is not "
            "known; import them with the column 'group', or do without abstention."
        )
    known = {id(model): model for model in plain}
    for form in forms:
        for part, role in ((form.fitted, "fitted"), (form.engine, "engine")):
            known.setdefault(id(part), part.called(f"{form.name}, {role}"))
    measured = run([*known.values()])
    for form in forms:
        pair = known[id(form.fitted)].name, known[id(form.engine)].name
        measured = add_models(measured, _chosen(measured, form, *pair))
    return measured.of_models([*names, *measured.header.predictions])


def _chosen(
    measured: Measurements, form: Abstaining, fitted: str, engine: str
) -> Measurements:
    """Return measurements of two models, by their slugs, chosen push by push."""
    header, errors = measured.header, measured.error_names
    known = [form.on(each.label) is form.fitted for each in header.conditions]
    here = DataArray(np.array(known)[measured.data["condition"].values], dims="sample")
    one, other = (measured.of_models([slug]).data for slug in (fitted, engine))
    row = one.assign({name: one[name].where(here, other[name]) for name in errors})
    return Measurements(row, structs.replace(header, models=(form.id,)))


def keeps_to_engine(model: str, engine: str, *, share: float) -> Rule:
    """Return the rule that a model errs at most a share more than its engine.

    For a model that leaves pushes to the engine: in every condition of both, at the
    upper end of every interval of a final error.
    """

    def is_wrong(summary: Summary, each: Comparison) -> bool:
        high = each.difference.high
        errors = summary.errors(engine, each.metric, each.condition)
        return high is None or high > share * errors[each.body - 1]

    def rule(summary: Summary) -> Verdict:
        conditions = [condition.label for condition in summary.conditions]
        pairs = [e for c in conditions for e in compared(summary, model, engine, c)]
        found = tuple(each for each in pairs if METRICS[each.metric].is_of_end)
        wrong = tuple(each for each in found if is_wrong(summary, each))
        status = "does not hold" if wrong else "holds"
        status = status if found else "not testable here"
        return Verdict(status, found, wrong, is_test=False)

    return rule
