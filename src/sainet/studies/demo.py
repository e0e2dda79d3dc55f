"""The whole method, small: simulate, train, compare, look."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import jax
import numpy as np
from jaxtyping import Float

from sainet.control.config import ControlConfig, Goals
from sainet.control.record import EpisodeRecord
from sainet.control.trials import run_trials
from sainet.datasets.batch import PushBatch, to_batch
from sainet.datasets.config import GenerateConfig
from sainet.datasets.store import Store
from sainet.evaluation.evaluate import PAPER_STEPS
from sainet.evaluation.measurements import Measurements
from sainet.evaluation.summary import Summary, summarise
from sainet.learning.recipes import PAPER
from sainet.models.dynamics import predict
from sainet.models.model import Model
from sainet.report.episode_frames import Replay, Track, outcome
from sainet.report.figures.paths import draw_error_over_time, draw_paths
from sainet.report.pages.page import REPORT, Report, write_report
from sainet.runs.documents import read_json, write_document
from sainet.runs.folders import open_run
from sainet.runs.manifest import MANIFEST
from sainet.scenes.state import State, Trajectory, pack_motion
from sainet.studies import DemoConfig
from sainet.studies.paper_setup import IN, SAIN, physics
from sainet.studies.runner import Runner
from sainet.studies.steps import Evaluate, Simulate, Train
from sainet.studies.study import TABLE, Result

_SUMMARY = """A robot pushes a disk that pushes another disk. An engine with assumed \
masses, radii and friction predicts such contacts badly (Physics); a network alone \
learns them from data (IN); SAIN takes the engine's prediction and learns the \
residual. All pushes here are simulated, with noise; the networks were trained on \
{pushes:,} pushes for {iterations:,} iterations of the paper's {paper:,}. Physics, \
true properties, uses the true masses and radii, and an assumed friction.

The replay shows the test push on which the engine has its median error. Then \
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
    config: DemoConfig, out: Path, runner: Runner, say: Callable[[str], None]
) -> DemoResult:
    """Run the method at small scale and write a report that plays.

    Args:
        config: size.
        out: folder of the demo.
        runner: of the steps, which are not repeated once they are finished.
        say: called with each stage.
    """
    settings = {"command": "demo", **asdict(config)}
    folder = open_run(out, settings, finished_by=REPORT, devices=jax.device_count())
    compared = _comparison(config)
    say("1 Simulating pushes, and what an engine with wrong properties predicts.")
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
    report = replace(report, table=summary, episodes=episodes)
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
    test = GenerateConfig(pushes=config.test_pushes, seed=config.seed + 1)
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
            (errors, "Mean position error of each disk over the time of a push."),
            (paths, "The push of the replay: predicted paths against the true one."),
        ),
        replays=(replay,),
        manifest=read_json(out / MANIFEST),
        commands=("sainet demo",),
    )


def _median_replay(
    models: list[Model], test: Store, evaluation: Measurements
) -> Replay:
    """Return the push on which physics has its median error."""
    error = evaluation.values("final_pos_mm", "physics").mean(axis=1)
    push = int(np.argsort(error)[len(error) // 2])
    return build_replay(
        models, test, push, title=f"Test push {push + 1}", steps=PAPER_STEPS
    )


def build_replay(
    models: Sequence[Model], store: Store, push: int, *, title: str, steps: int
) -> Replay:
    """Return one push as it was and as each model predicts it.

    Args:
        models: in the order of the legend.
        store: holds the push.
        push: its index.
        title: of the replay.
        steps: how many to show.
    """
    arrays = store.read(slice(push, push + 1))
    batch = to_batch(arrays, store.info, steps=steps)
    pusher = _with_start(
        batch.initial.pusher_position, arrays["truth_pusher"][:, :steps]
    )
    motion = _with_start(_pose(batch.initial), np.asarray(batch.truth[..., :3]))
    tracks = {"truth": Track(motion[..., :2], motion[..., 2], pusher)}
    for model in models:
        tracks[model.name] = _track(_predict(model, batch), batch.initial)
    return Replay(
        title=title,
        time_step=store.info.time_step,
        radius=tuple(float(r) for r in arrays["radius"][0]),
        pusher_radius=float(arrays["pusher_radius"][0]),
        tracks=tracks,
    )


def error_curves(
    models: Sequence[Model], store: Store, *, steps: int, pushes: int
) -> dict[str, Float[np.ndarray, "time body"]]:
    """Return each model's mean position error (mm) over the time of a push."""
    arrays = store.read(slice(0, min(pushes, store.info.pushes)))
    batch = to_batch(arrays, store.info, steps=steps)
    true = np.asarray(batch.truth[..., :2])
    curves = {}
    for model in models:
        predicted = np.asarray(_predict(model, batch).states.position)
        error = 1000 * np.linalg.norm(predicted - true, axis=-1)
        curves[model.name] = error.mean(axis=0)
    return curves


def _predict(model: Model, batch: PushBatch) -> Trajectory:
    return predict(model.dynamics, batch.scene, batch.initial, batch.controls)


def _track(trajectory: Trajectory, initial: State) -> Track:
    states = trajectory.states
    motion = _with_start(_pose(initial), _pose(states))
    pusher = _with_start(initial.pusher_position, np.asarray(states.pusher_position))
    return Track(motion[..., :2], motion[..., 2], pusher)


def _pose(state: State) -> np.ndarray:
    return np.asarray(pack_motion(state)[..., :3])


def _with_start(start: object, rest: np.ndarray) -> np.ndarray:
    """Put the state before the push in front of what follows, of a single push."""
    return np.concatenate([np.asarray(start), rest[0]], axis=0)
