"""The whole method, small: simulate, train, compare, look."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import jax
import numpy as np

from sainet.control.config import ControlConfig
from sainet.control.record import EpisodeRecord
from sainet.control.trials import run_trials
from sainet.datasets.config import GenerateConfig
from sainet.datasets.store import Store
from sainet.evaluation.evaluate import PAPER_STEPS
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.summary import Summary, summarise
from sainet.learning.recipes import PAPER
from sainet.models.model import Model
from sainet.report.episode_frames import outcome
from sainet.report.figures.paths import draw_error_over_time, draw_paths
from sainet.report.pages.page import REPORT, Report, write_report
from sainet.report.replays import build_replay, error_curves
from sainet.runs.documents import read_json, write_document
from sainet.runs.folders import open_run
from sainet.runs.manifest import MANIFEST
from sainet.scenes.quantities import LARGEST_SEED
from sainet.studies import DemoConfig
from sainet.studies.paper_setup import IN, SAIN, physics
from sainet.studies.runner import Runner
from sainet.studies.steps import Evaluate, Simulate, Train
from sainet.studies.study import TABLE, Result
from sainet.tasks import Goals

_SUMMARY = """A robot pushes a disk that pushes another disk. An engine with assumed \
masses, radii and friction predicts such contacts poorly (Physics); a network alone \
learns them from data (IN); SAIN takes the engine's prediction and learns the \
residual. All pushes here are simulated, with noise; the networks were trained on \
{pushes:,} pushes for {iterations:,} iterations of the paper's {paper:,}. Physics, \
true properties, uses the true masses and radii, and an assumed friction.

The replay shows a typical test push: for both disks, the final position error of SAIN \
over that of physics is nearest to the median of all {test_pushes:,} test pushes. Then \
the SAIN that ships with the package, trained for all {paper:,}, pushes disk 2 to an \
easy and to a hard goal by the paper's search, and so does physics; that world is \
simulated as well, with disks, friction and noise that differ from those of the \
internal engine."""
GOALS: tuple[Goals, ...] = ("easy", "hard")


@dataclass(frozen=True)
class DemoResult:
    """What the demo made."""

    report: Path
    summary: Summary


def run_demo(
    config: DemoConfig,
    out: Path,
    runner: Runner,
    say: Callable[[str], None],
    command: str,
) -> DemoResult:
    """Run the method at small scale and write a report that plays.

    Args:
        config: size.
        out: folder of the demo.
        runner: of the steps, which are not repeated once they are finished.
        say: called with each stage.
        command: that runs the demo with these settings, for the report.
    """
    settings = {"command": "demo", **asdict(config)}
    compared = _comparison(config)
    folder = open_run(out, settings, finished_by=REPORT, devices=jax.device_count())
    say("1 Simulating pushes, and the predictions of an engine with wrong properties.")
    *_, network = compared.models
    assert isinstance(network, Train)
    runner.result(network.pushes)
    test = runner.result(compared.pushes)
    say("2 Training the network alone (IN), then around the engine (SAIN).")
    models = [runner.result(model) for model in compared.models]
    say("3 Comparing physics, IN and SAIN on pushes that no network was trained on.")
    measured = runner.result(compared)
    summary = summarise(measured)
    measured.write(out / "measurements.nc")
    write_document(out / TABLE, Result(summary=summary))
    say("4 Pushing disk 2 to an easy and to a hard goal, with SAIN and with physics.")
    episodes = [
        push_to_goal(runner, goals, config, model)
        for goals in GOALS
        for model in ("sain", "physics")
    ]
    say("5 Drawing the figures and the report.")
    report = _draw(models, test, measured, config, out)
    report = replace(report, table=summary, episodes=episodes, commands=(command,))
    return DemoResult(write_report(report, folder.path / REPORT), summary)


def push_to_goal(
    runner: Runner, goals: Goals, config: DemoConfig, model: str
) -> EpisodeRecord:
    """Return the episode of one goal, pushed to with physics or the shipped SAIN.

    A network of 300 iterations overshoots the goal, and no push from behind returns
    the disk.
    """
    settings = ControlConfig(model=model, goals=goals, trials=1, seed=config.seed)
    with runner.bar(f"Pushing ({goals}, {model})", 1) as bar:

        def on_episode(record: EpisodeRecord) -> None:
            bar.add(1, outcome(record))

        return run_trials(
            settings, runner.out / f"{goals}-{model}", on_episode=on_episode
        )[0]


def _comparison(config: DemoConfig) -> Evaluate:
    """Return the comparison of physics with both networks, on test pushes."""
    train = GenerateConfig(pushes=config.pushes, seed=config.seed)
    other = (config.seed + 1) % (LARGEST_SEED + 1)
    test = GenerateConfig(pushes=config.test_pushes, seed=other)
    quarter = max(config.iterations // 4, 1)
    recipe = PAPER.changed(
        iterations=config.iterations,
        halve_every=quarter,
        learning_rate=2e-3,
        log_every=min(10, quarter),
        seed=config.seed,
    )
    pushes = Simulate("train", train)
    networks = (Train(network, pushes, recipe) for network in (IN, SAIN))
    return Evaluate((*physics(), *networks), Simulate("test", test))


def _draw(
    models: list[Model],
    test: Store,
    evaluation: Measurements,
    config: DemoConfig,
    out: Path,
) -> Report:
    final = [evaluation.values("final_pos_mm", name) for name in ("sain", "physics")]
    push = typical_push(final[0] / final[1])
    title = f"Test push {push} (counted from 0)"
    replay = build_replay(models, test, push, title=title, steps=PAPER_STEPS)
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
            test_pushes=config.test_pushes,
            iterations=config.iterations,
            paper=PAPER.optimiser.iterations,
        ),
        figures=(
            (errors, "Mean position error of each disk over the time of a push."),
            (paths, "The push of the replay: predicted paths against the true one."),
        ),
        replays=(replay,),
        manifest=read_json(out / MANIFEST),
    )


def typical_push(share: np.ndarray) -> int:
    """Return the push whose shares are nearest to the medians of all pushes.

    Args:
        share: error of one model over that of another, ``[push, body]``.
    """
    off = np.log(share / np.median(share, axis=0))
    return int(np.abs(off).sum(axis=-1).argmin())
