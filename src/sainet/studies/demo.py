"""The whole method, small: simulate, train, compare, look."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import jax
import numpy as np

from sainet.control.config import ControlConfig, Goals
from sainet.control.trials import run_trials
from sainet.datasets.config import GenerateConfig
from sainet.datasets.store import Store
from sainet.evaluation.evaluate import PAPER_STEPS
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.summary import Summary, summarise
from sainet.learning.recipes import PAPER
from sainet.models.library import Model
from sainet.report.episode_frames import outcome
from sainet.report.figures.paths import draw_error_over_time, draw_paths
from sainet.report.pages.page import REPORT, Report, write_report
from sainet.report.replay import Replay
from sainet.runs.documents import read_json, write_document
from sainet.runs.folders import open_run
from sainet.runs.manifest import MANIFEST
from sainet.studies.chain import Chain
from sainet.studies.config import DemoConfig
from sainet.studies.replays import build_replay, error_curves
from sainet.studies.result import TABLE, Result

_SUMMARY = """A robot pushes a disk that pushes another disk. An engine with assumed \
masses, radii and friction predicts such contacts badly (Physics); a network alone \
learns them from data (IN); SAIN takes the engine's prediction and learns what is \
wrong about it. All pushes here are simulated, with noise; the networks saw {pushes:,} \
pushes for {iterations:,} iterations of the paper's {paper:,}. Physics, true \
properties, uses the true masses and radii, and an assumed friction.

The replay shows the test push on which the engine is wrong by the median amount. Then \
the SAIN that ships with the package, trained for all {paper:,}, pushes disk 2 to an \
easy and to a hard goal by the paper's search; that world is simulated as well, with \
disks, friction and noise that the engine inside does not know."""
GOALS: tuple[Goals, ...] = ("easy", "hard")


@dataclass(frozen=True)
class DemoResult:
    """What the demo made."""

    report: Path
    summary: Summary


def run_demo(config: DemoConfig, chain: Chain) -> DemoResult:
    """Run the chain small and write a report that plays.

    Args:
        config: how small.
        chain: does the steps; what is finished in its folder is not made again.
    """
    out = chain.out
    settings = {"command": "demo", **asdict(config)}
    folder = open_run(out, settings, finished_by=REPORT, devices=jax.device_count())
    test = _simulate_and_train(chain, config)
    models = chain.models()
    chain.say("[bold]3[/] Comparing physics, IN and SAIN on pushes that none has seen.")
    evaluation = chain.compare(models, test)
    summary = summarise(evaluation)
    evaluation.write(out / "measurements.nc")
    write_document(out / TABLE, Result(summary=summary))
    chain.say("[bold]4[/] Pushing disk 2 to an easy and to a hard goal with SAIN.")
    episodes = [push_to_goal(chain, goals, config) for goals in GOALS]
    chain.say("[bold]5[/] Drawing the figures and the report.")
    report = _draw(models, test, evaluation, config, out)
    report = replace(report, table=summary, episodes=episodes)
    return DemoResult(write_report(report, folder.path / REPORT), summary)


def push_to_goal(chain: Chain, goals: Goals, config: DemoConfig) -> dict[str, Any]:
    """Return the episode of one goal, pushed to with the SAIN that ships.

    One of 300 iterations overshoots the goal, and no push from behind brings it back.
    """
    settings = ControlConfig(model="sain", goals=goals, trials=1, seed=config.seed)
    with chain.bar(f"Pushing ({goals})", 1) as advance:

        def on_episode(record: dict[str, Any]) -> None:
            advance(1, outcome(record))

        return run_trials(settings, chain.out / goals, on_episode=on_episode)[0]


def _simulate_and_train(chain: Chain, config: DemoConfig) -> Store:
    """Make the datasets and both networks; returns the test set."""
    chain.say("[bold]1[/] Simulating pushes, and what a wrong engine predicts of them.")
    train = chain.simulate(
        "train", GenerateConfig(pushes=config.pushes, seed=config.seed)
    )
    test = chain.simulate(
        "test", GenerateConfig(pushes=config.test_pushes, seed=config.seed + 1)
    )
    chain.say(
        "[bold]2[/] Training the network alone (IN), then around the engine (SAIN)."
    )
    quarter = max(config.iterations // 4, 1)
    recipe = PAPER.changed(
        iterations=config.iterations,
        halve_every=quarter,
        learning_rate=2e-3,
        log_every=min(10, quarter),
        seed=config.seed,
    )
    chain.train("in", train, recipe)
    chain.train("sain", train, recipe)
    return test


def _draw(
    models: list[Model],
    test: Store,
    evaluation: Measurements,
    config: DemoConfig,
    out: Path,
) -> Report:
    replay = _median_replay(models, test, evaluation)
    curves = error_curves(models, test, steps=PAPER_STEPS, pushes=config.test_pushes)
    paths = draw_paths(replay, out / "paths.svg")
    errors = draw_error_over_time(
        curves, out / "error-over-time.svg", time_step=test.info.time_step
    )
    return Report(
        title="Simulator-augmented interaction networks, at small scale",
        subtitle="A robot pushes a disk that pushes another: engine, network, and both",
        summary=_SUMMARY.format(
            pushes=config.pushes,
            iterations=config.iterations,
            paper=PAPER.optimiser.iterations,
        ),
        figures=(
            (paths, "The push of the replay: predicted paths against the true one."),
            (errors, "Mean position error of each disk over the time of a push."),
        ),
        replays=(replay,),
        manifest=read_json(out / MANIFEST),
        commands=("sainet demo",),
    )


def _median_replay(
    models: list[Model], test: Store, evaluation: Measurements
) -> Replay:
    """Return the push on which physics is wrong by the median amount: no cherry."""
    error = evaluation.values("final_pos_mm", "physics").mean(axis=1)
    push = int(np.argsort(error)[len(error) // 2])
    return build_replay(
        models, test, push, title=f"Test push {push + 1}", steps=PAPER_STEPS
    )
