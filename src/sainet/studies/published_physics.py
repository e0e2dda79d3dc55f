"""The published errors of Physics: does any plausible setting give them?

The paper states the stroke (1 cm in 2 s) and the assumed properties, but neither the
noise, which it calls significant, nor how the force is resisted. Over a grid of both,
of the overlap at the start and of the steps that count, each error is set beside the
published one.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from sainet.datasets.config import GenerateConfig
from sainet.evaluation.claims import Claim, Verdict
from sainet.evaluation.measurements import Condition, PublishedValues
from sainet.evaluation.summary import BASELINE, Summary
from sainet.report.figures.curves import METRICS
from sainet.report.figures.overview import Ranges, draw_ranges
from sainet.studies import Scale
from sainet.studies.paper_setup import physics
from sainet.studies.paper_tables import (
    PUBLISHED_DIRECT_FORCE_TWO_DISKS,
    PUBLISHED_ROBOT_TWO_DISKS,
)
from sainet.studies.steps import Evaluate, Join, Simulate
from sainet.studies.study import Choice, Plan, Scope, Study
from sainet.worlds.noise import NoiseConfig

# Damping (N s/m) and a force (N) against it. The weakest damper lets disk 1 travel some
# 2 cm, twice the paper's stroke: a smaller force leaves more disks at rest.
DRIVES = ((1000.0, 8.0), (300.0, 4.5), (100.0, 3.5))
SPEEDS_MM_S = (50.0, 5.0)  # of the robot; the slower one takes the paper's 2 s
GAPS_MM = (0.0, -2.0, -4.0)
NOISES = (1, 3, 10)  # multiples of the noise of the pusher: of its path or force
FORCE_STEPS = (200, 480)  # that count: the paper's, and the whole 2 s
PUSHES = {"quick": 16, "paper": 100}
NEAR = 1.2  # ratio to the published error, either way
_SEED = 300


@dataclass(frozen=True)
class Setting:
    """One way to simulate the pushes of a published table."""

    config: GenerateConfig
    noise: int = 1  # multiple of the noise of the pusher
    steps: int | None = None  # that count; None: the first 200

    @property
    def factors(self) -> dict[str, float | str]:
        """What varies over the grid."""
        config = self.config
        drive: dict[str, float | str] = {"speed_mm_s": config.speed_mm_s[0]}
        if config.setup == "direct-force":
            drive = {"damping_n_s_m": config.damping_n_s_m, "force_n": config.force_n}
        counted: dict[str, float | str] = {"steps": self.steps} if self.steps else {}
        return {
            "setup": config.setup,
            **drive,
            "gap_mm": config.gap_mm,
            "pusher_noise": self.noise,
            **counted,
        }

    @property
    def drive(self) -> str:
        """What moves the disks."""
        config = self.config
        if config.setup == "direct-force":
            return f"{config.damping_n_s_m:g} N s/m, {config.force_n:g} N"
        return f"{config.speed_mm_s[0]:g} mm/s"

    @property
    def counted(self) -> str:
        """The steps that count, where that varies; continues a sentence."""
        return f", {self.steps} steps" if self.steps else ""

    @property
    def label(self) -> str:
        """The setting in words."""
        gap, noise = self.config.gap_mm, self.noise
        return f"{self.drive}, gap {gap:g} mm, noise × {noise}{self.counted}"  # noqa: RUF001

    def pushes(self, count: int) -> Simulate:
        """Return the pushes of the setting, simulated by Bullet."""
        usual = NoiseConfig()
        noise = replace(
            usual,
            tracking_mm=self.noise * usual.tracking_mm,
            force_fraction=self.noise * usual.force_fraction,
        )
        whole = replace(
            self.config,
            noise=noise,
            pushes=count,
            seed=_SEED,
            chunk_size=min(count, 50),
            engine="bullet",
            assumed_engine=("bullet", "bullet-true"),
        )
        return Simulate(f"physics-{self.config.setup}", whole)

    def published(self) -> PublishedValues:
        """Return the published errors of Physics."""
        table = PUBLISHED_ROBOT_TWO_DISKS
        if self.config.setup == "direct-force":
            table = PUBLISHED_DIRECT_FORCE_TWO_DISKS
        return table[0]


def grid(scale: Scale) -> Iterator[Setting]:
    """Yield every setting; quick studies have the usual noise and no overlap."""
    gaps, noises = (GAPS_MM, NOISES) if scale == "paper" else (GAPS_MM[:1], NOISES[:1])
    for gap, noise in product(gaps, noises):
        common = GenerateConfig(gap_mm=gap)
        for damping, force in DRIVES:
            driven = replace(
                common, setup="direct-force", damping_n_s_m=damping, force_n=force
            )
            yield from (Setting(driven, noise, steps) for steps in FORCE_STEPS)
        for speed in SPEEDS_MM_S:
            yield Setting(replace(common, speed_mm_s=(speed,)), noise)


def furthest(summary: Summary, setting: Setting, metric: str = "pos_mm") -> float:
    """Return the largest ratio between an error and the published one, either way."""
    ours = summary.errors(BASELINE, metric, setting.label)
    theirs = [value for value in setting.published().values[metric] if value]
    ratios = [our / their for our, their in zip(ours, theirs, strict=True)]
    return max(max(ratio, 1 / ratio) for ratio in ratios)


def _plan(scope: Scope) -> Plan:
    count = PUSHES[scope.scale]
    models = physics("bullet")
    return Plan(
        Join(
            tuple(
                Evaluate(
                    models,
                    setting.pushes(count),
                    Condition(label=setting.label, factors=setting.factors),
                    setting.steps,
                )
                for setting in grid(scope.scale)
            )
        )
    )


def _measured(summary: Summary) -> tuple[Setting, ...]:
    labels = {each.label for each in summary.conditions}
    return tuple(each for each in grid("paper") if each.label in labels)


def _is_near(metrics: tuple[str, ...]) -> Claim:
    words = "positions and rotations" if len(metrics) > 1 else "positions"

    def rule(summary: Summary) -> Verdict:
        settings = _measured(summary)
        if not settings:
            return Verdict("not testable here")
        near = any(
            all(furthest(summary, setting, metric) <= NEAR for metric in metrics)
            for setting in settings
        )
        return Verdict("holds" if near else "does not hold")

    text = f"some setting gives the published {words} of Physics within 20 %"
    return Claim(text, rule)


def closest(summary: Summary) -> tuple[Choice, ...]:
    """Return the settings, each with its distance from the published positions."""
    found = [
        Choice(condition=each.label, score=furthest(summary, each))
        for each in _measured(summary)
    ]
    return tuple(sorted(found, key=lambda each: each.score))


def _draw(summary: Summary, path: Path) -> Path:
    """Draw errors over the published ones: of each drive, the mean and the range."""
    panels: dict[str, Ranges] = {}
    for metric, label in METRICS.items():
        rows = panels[f"{label} over the published"] = defaultdict(dict)
        for each in _measured(summary):
            ours = np.sum(summary.errors(BASELINE, metric, each.label))
            theirs = np.sum(np.array(each.published().values[metric], float))
            row = rows[each.config.setup].setdefault(each.drive + each.counted, [])
            row.append(float(ours / theirs))
    return draw_ranges(panels, path)


STUDY = Study(
    question="Does any plausible setting give the published errors of Physics?",
    plan=_plan,
    compares=False,
    choose=closest,
    figure=_draw,
    claims=(_is_near(("pos_mm",)), _is_near(("pos_mm", "rot_deg"))),
)
