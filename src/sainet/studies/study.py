"""Studies: a question, the steps that answer it, and what is made of their results."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from sainet.datasets.store import Store, open_store
from sainet.engines import make_engine
from sainet.evaluation.as_json import to_json_object
from sainet.evaluation.claims import Claim
from sainet.evaluation.measurements import Measurements, PublishedValues
from sainet.evaluation.predictions import EndOffsets
from sainet.evaluation.rulings import rule_on
from sainet.evaluation.summary import Summary, summarise
from sainet.models.card import CARD, WEIGHTS, read_card
from sainet.report.figures.engine_errors import draw_engine_errors
from sainet.runs.documents import write_bytes, write_document, write_json
from sainet.runs.errors import BadInput, BadStore
from sainet.runs.folders import CONFIG
from sainet.runs.manifest import MANIFEST, manifest
from sainet.studies import Scale
from sainet.studies.runner import Runner
from sainet.studies.steps import Step, Train

TABLE = "table.json"
MEASUREMENTS, AS_TRAINED = "measurements.nc", "as-trained.nc"
ENGINE_ERRORS = "engine-errors.svg"
QUICK_RECORDED = 40  # pushes of each group, at the quick scale
STEPS = "steps"  # folder of the run folders that studies share


# Settings of a recipe that differ from its defaults, by name.
Change = dict[str, bool | int | float | str]


class Choice(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One setting that a study tried, and its score: errors over those of physics."""

    score: float
    condition: str | None = None  # label
    l2: float | None = None
    pushes: int | None = None
    start: str | None = None
    change: Change | None = None  # to the defaults
    scores: dict[str, float] | None = None  # by robot

    @property
    def cells(self) -> dict[str, str]:
        """The settings and the scores in words, by the headings of a table."""
        found: dict[str, str] = {}
        if self.l2 is not None:
            found["l2"] = f"{self.l2:g}"
        if self.condition is not None:
            found["setting"] = self.condition
        if self.start is not None:
            changes = (self.change or {}).items()
            words = ", ".join(f"{k.replace('_', ' ')} {v}" for k, v in changes)
            found["pushes"] = str(self.pushes)
            found["way"] = f"from `{self.start}`, {words or 'the defaults'}"
        scores = {**(self.scores or {}), "score": self.score}
        return found | {name: f"{value:.3f}" for name, value in scores.items()}


class Ruling(msgspec.Struct, frozen=True, omit_defaults=True):
    """A claim and its verdict."""

    claim: str
    status: str
    p: float | None = None  # as of `evaluation.rulings.Ruled`


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a study, as it is kept in its folder."""

    summary: Summary
    as_trained: Summary | None = None  # of pushes like those of the training
    choices: tuple[Choice, ...] = ()
    claims: tuple[Ruling, ...] = ()
    seal: str = ""  # hash of all other fields

    def to_json(self) -> Mapping[str, object]:
        """Return the JSON object that commands print."""
        found = to_json_object(self.summary)
        if self.as_trained is not None:
            found["as_trained"] = to_json_object(self.as_trained)
        if self.choices:
            found["choices"] = msgspec.to_builtins(self.choices)
        if self.claims:
            found["claims"] = msgspec.to_builtins(self.claims)
        return found


class MissingInput(BadInput):
    """A study without data that it needs."""


@dataclass(frozen=True)
class Scope:
    """What the steps of a study depend on: its size and the recorded pushes."""

    scale: Scale
    recorded: Path | None = None  # dataset that 'sainet import' made
    trainings: int | None = None  # of each network, at most; None: all

    def seeds(self, trainings: int, first: int = 0) -> range:
        """Return the seeds of the training runs of a network.

        Args:
            trainings: at the scale paper; the quick scale has one.
            first: seed.
        """
        wanted = 1 if self.scale == "quick" else trainings
        return range(first, first + min(wanted, self.trainings or wanted))

    def recorded_pushes(self, quick: int | None = None) -> Store:
        """Return the recorded pushes; at the quick scale a few of each group.

        Args:
            quick: how many of each group; default: `QUICK_RECORDED`.

        Raises:
            MissingInput: none were given.
            BadStore: they cannot be used, or were simulated.
        """
        if self.recorded is None:
            raise MissingInput(
                "`recorded` is missing: give the dataset that 'sainet import "
                "mitpush-endpoints' made of recorded pushes."
            )
        store = open_store(self.recorded)
        if not store.info.is_recorded:
            raise BadStore(f"{store.path}: simulated; `recorded` takes imported ones.")
        return store if self.scale == "paper" else _some_of_each_group(store, quick)


def _some_of_each_group(store: Store, most: int | None) -> Store:
    """Return pushes from the whole of each group, in their order."""
    group = store.read(slice(None), ("group",))["group"]
    chosen: list[np.ndarray] = []
    for rows in (np.flatnonzero(group == code) for code in np.unique(group)):
        few = np.linspace(0, len(rows) - 1, min(len(rows), most or QUICK_RECORDED))
        chosen.append(rows[few.round().astype(int)])
    return store.take(np.sort(np.concatenate(chosen)))


Need = Callable[[Scope], object]  # raises what is missing


BULLET: Need = lambda scope: make_engine("bullet")  # noqa: E731
RECORDED: Need = Scope.recorded_pushes


@dataclass(frozen=True)
class Plan:
    """The steps of a study at one scale; their inputs are steps as well."""

    measured: Step[Measurements]
    as_trained: Step[Measurements] | None = None
    engine_errors: Mapping[str, Step[EndOffsets]] = field(default_factory=dict)
    networks: tuple[Train, ...] = ()  # copied into the folder of the study


def last_steps(plans: Iterable[Plan]) -> Iterator[Step[Any]]:
    """Yield the steps that studies ask for; all others are inputs of these."""
    for plan in plans:
        yield from (plan.measured, *plan.networks, *plan.engine_errors.values())
        if plan.as_trained is not None:
            yield plan.as_trained


@dataclass(frozen=True, kw_only=True)
class Study:
    """A question, and how it is answered."""

    question: str
    plan: Callable[[Scope], Plan]
    needs: tuple[Need, ...] = (BULLET,)
    published: tuple[PublishedValues, ...] = ()
    claims: tuple[Claim, ...] = ()
    subject: str = ""  # slug of the model that all others are compared with
    compares: bool = True  # models with each other, not only with the truth
    choose: Callable[[Summary], tuple[Choice, ...]] = lambda summary: ()
    figure: Callable[[Summary, Path], Path] | None = None

    def check(self, scope: Scope) -> None:
        """Raise the error of the first need that is not met.

        Raises:
            MissingExtra: a package is not installed.
            MissingInput: no recorded pushes were given.
            BadStore: the recorded pushes cannot be used.
        """
        for need in self.needs:
            need(scope)

    def summarise(self, measured: Measurements) -> Summary:
        """Return the summary of measurements of this study."""
        found = summarise(measured, subject=self.subject)
        kept = found.comparisons if self.compares else ()
        return msgspec.structs.replace(found, comparisons=kept)

    def run(
        self,
        name: str,
        scope: Scope,
        runner: Runner,
        out: Path,
        *,
        command: Sequence[str] = (),
    ) -> Result:
        """Run the steps and write table, measurements, figures and origin.

        Args:
            name: of the study.
            scope: scale and recorded pushes.
            runner: of the steps.
            out: folder of the study.
            command: that runs the study, for the origin of its measurements.
        """
        plan = self.plan(scope)
        measured = runner.result(plan.measured).with_published(self.published)
        measured = measured.made_by(*command)
        summary, as_trained = self.summarise(measured), None
        measured.write(out / MEASUREMENTS)
        if plan.as_trained is not None:
            found = runner.result(plan.as_trained).made_by(*command)
            found.write(out / AS_TRAINED)
            as_trained = self.summarise(found)
        result = Result(
            summary=summary,
            as_trained=as_trained,
            choices=self.choose(summary),
            claims=tuple(
                Ruling(each.claim.text, each.status, each.p)
                for each in rule_on(self.claims, summary)
            ),
        )
        if self.figure is not None:
            self.figure(summary, out / f"{name}.svg")
        if plan.engine_errors:
            cases = {k: runner.result(v) for k, v in plan.engine_errors.items()}
            draw_engine_errors(cases, out / ENGINE_ERRORS)
        for step in plan.networks:
            folder, target = runner.folder(step), out / "networks" / step.id.slug
            write_bytes(target / WEIGHTS, (folder / WEIGHTS).read_bytes())
            write_document(target / CARD, read_card(folder))
        content = scope.recorded and open_store(scope.recorded).content
        made = {"command": "reproduce", "study": name, "recorded": content}
        write_json(out / CONFIG, made)
        write_document(out / MANIFEST, manifest())
        write_document(out / TABLE, result)
        return result
