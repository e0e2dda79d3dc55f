"""Do pushes in virtual labs look like recorded pushes?

Each lab repeats the recorded single-disk pushes: same poses, same paths. The errors of
the unchanged planar engine on both are compared. Nothing is trained.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from sainet.datasets.schema import Arrays
from sainet.datasets.store import Store
from sainet.evaluation.joining import without_predictions
from sainet.evaluation.measurements import Condition, Measurements
from sainet.robots import SURFACES, Surface
from sainet.robots.lab.hidden import LABS, Lab, draw_lab
from sainet.robots.lab.mechanics import TICK, Mechanics
from sainet.robots.lab.robot import CLEARANCE, approach
from sainet.studies.paper_setup import physics
from sainet.studies.recorded_models import surfaces_of
from sainet.studies.recorded_pushes import EndErrors
from sainet.studies.steps import Derive, Evaluate, Given, Join, Step
from sainet.studies.study import RECORDED, Plan, Scope, Study

if TYPE_CHECKING:
    from sainet.studies.runner import Runner

_GENERATOR = 0x4EA1
_HOLD = 0.4  # s
_DRAWN = 1  # labs beside the recorded pushes in the figure


class Repeat(Derive):
    """Recorded pushes, repeated in a virtual lab."""

    number: int
    surface: Surface

    @property
    def name(self) -> str:
        """The surface and the number of the lab."""
        return f"{self.surface}-lab-{self.number}"

    def change(self, arrays: Arrays) -> Arrays:
        """Return the pushes with the final poses that the lab's tracker measures."""
        lab = draw_lab(self.number, self.surface, order=(0,))
        end = _repeat(lab, arrays)
        truth = np.full_like(arrays["truth"], np.nan)
        rows = np.arange(len(truth))
        truth[rows, arrays["steps"] - 1, 0, :3] = end
        return arrays | {"truth": truth}


def _repeat(lab: Lab, arrays: Arrays) -> Float[np.ndarray, "push 3"]:
    """Return the measured final poses of disk 1."""
    seen = arrays["initial"][:, :1, :3].astype(np.float64)
    pose = lab.capture.unseen(seen)
    start = arrays["initial_pusher"].astype(np.float64)
    normal = seen[:, 0, :2] - start
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    command = np.concatenate([start[:, None], arrays["command_position"]], 1)
    ticks = int((command.shape[1] / 240 + _HOLD) / TICK)
    moments = np.minimum(np.arange(1, ticks + 1) * TICK * 240, command.shape[1] - 1)
    before = np.floor(moments).astype(int)
    after = np.minimum(before + 1, command.shape[1] - 1)
    part = (moments - before)[None, :, None]
    path = (1 - part) * command[:, before] + part * command[:, after]
    nearing = start[:, None] + (approach() - CLEARANCE)[:, None] * normal[:, None]
    rng = np.random.default_rng([_GENERATOR, lab.number])
    friction = np.array(
        [
            lab.friction_of_push(rng, each[0], at)
            for each, at in zip(pose, start, strict=True)
        ]
    )
    motion = Mechanics(lab, len(pose)).run(
        pose, np.concatenate([nearing, path], 1), friction
    )
    return lab.capture.measured(rng, motion.pose[:, -1, 0])


class _OfEngines(Join):
    """Measurements without the model whose predictions came with recorded pushes."""

    def run(self, runner: "Runner") -> Measurements:
        """Return the measurements of all parts."""
        return without_predictions(super().run(runner))


def _plan(scope: Scope) -> Plan:
    """Return the engine's errors on recorded pushes and on those of each lab."""
    store = scope.recorded_pushes()
    parts, errors = [], {}
    engine = physics()[0]
    for surface in SURFACES:
        rows = surfaces_of(store).get(surface)
        if rows is None:
            continue
        recorded = Given(store.take(rows))
        cases: Mapping[str, Step[Store]] = {
            "recorded": recorded,
            **{
                f"virtual lab {number}": Repeat(recorded, number, surface)
                for number in range(LABS)
            },
        }
        for name, pushes in cases.items():
            condition = Condition(
                label=f"{surface}, {name}", factors={"surface": surface, "world": name}
            )
            parts.append(Evaluate((engine,), pushes, condition))
        for name, pushes in list(cases.items())[: 1 + _DRAWN]:
            errors[f"{surface}, {name}"] = EndErrors(engine, pushes)
    return Plan(_OfEngines(tuple(parts)), engine_errors=errors)


STUDY = Study(
    question="Are the engine's errors in the virtual labs like those on recorded "
    "pushes?",
    plan=_plan,
    needs=(RECORDED,),
    compares=False,
)
