"""Benchmarks count the stated work, measure it and compare equal work."""

import json
import math
import subprocess
import sys
import time
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import pytest
from jax.extend.core import ClosedJaxpr, Jaxpr

from sainet.bench import CASES
from sainet.bench import start as start_case
from sainet.bench import training as training_case
from sainet.bench.timing import ceiling_gflops, median_seconds
from sainet.bench.training import (
    Problem,
    TorchPeer,
    TorchRun,
    TrainingLoop,
    counted_gflop,
    make_problem,
    missing_torch,
    run_torch,
    save_problem,
)
from sainet.cli.bench import Bench, bench_commands
from sainet.cli.output import Output
from sainet.learning.step import trained_layers, with_layers
from sainet.models.correctors.interaction import InteractionNetwork
from sainet.models.features import feature_set
from sainet.models.inputs import Drive, Still, in_columns
from sainet.planning.tree import TreePlanner
from sainet.runs.errors import BadInput, SainetError, UnknownName
from sainet.runs.names import load_named
from sainet.scenes.pushes import PushGrid

TIME_STEP = 1 / 240
load_case = partial(load_named, "benchmark", CASES)


def network_of(kind: str, *, augmented: bool) -> InteractionNetwork:
    features = feature_set(kind, simulator=augmented)
    return InteractionNetwork(features, time_step=TIME_STEP, key=jax.random.key(0))


def test_the_counted_work_equals_a_count_by_hand():
    rel = 15 * 128 + 128 * 64 + 64 * 32 + 32 * 16
    dyn = 29 * 128 + 128 * 64 + 64 * 32 + 32 * 16 + 16 * 3
    by_hand = 3 * 2 * (2 * rel + 2 * dyn) * 100 * 200 / 1e9
    network = network_of("robot", augmented=True)
    assert counted_gflop(network, 100, 200, 2) == pytest.approx(by_hand)
    assert by_hand == pytest.approx(6.52, abs=0.01)


def products(jaxpr: Jaxpr) -> int:
    """Operations of all matrix products, 2 M K N each, at any depth."""
    total = 0
    for equation in jaxpr.eqns:
        if equation.primitive.name == "dot_general":
            (contracted, _), _ = equation.params["dimension_numbers"]
            shape = equation.invars[0].aval.shape
            inner = math.prod(shape[axis] for axis in contracted)
            total += 2 * equation.outvars[0].aval.size * inner
        nested = jax.tree.leaves(equation.params, is_leaf=is_jaxpr)
        total += sum(products(getattr(j, "jaxpr", j)) for j in nested if is_jaxpr(j))
    return total


def is_jaxpr(value: object) -> bool:
    return isinstance(value, Jaxpr | ClosedJaxpr)


@pytest.mark.parametrize("bodies", [2, 3])
@pytest.mark.parametrize("augmented", [False, True])
@pytest.mark.parametrize("kind", ["robot", "direct-force"])
def test_the_counted_work_equals_the_compiled_work(kind, augmented, bodies):
    network, pushes = network_of(kind, augmented=augmented), 7
    drive, still = driven(kind, augmented, pushes, bodies), stills(pushes, bodies)

    def loss(layers, motion):
        step = with_layers(network, layers).step
        return jnp.sum(step(*in_columns((motion, still, drive))) ** 2)

    gradient = jax.value_and_grad(loss, argnums=(0, 1))
    motion = jnp.ones((pushes, bodies, 6))
    jaxpr = jax.make_jaxpr(gradient)(trained_layers(network), motion)
    counted = counted_gflop(network, pushes, 1, bodies)
    assert products(jaxpr.jaxpr) == round(counted * 1e9)


def driven(kind: str, augmented: bool, pushes: int, bodies: int) -> Drive:
    action = jnp.ones((pushes, 2 if kind == "robot" else 4))
    pusher = jnp.ones((pushes, 2)) if kind == "robot" else None
    step = jnp.ones((pushes, bodies, 3)) if augmented else None
    return Drive(action, pusher, step, step)


def stills(pushes: int, bodies: int) -> Still:
    each, place = jnp.ones((pushes, bodies)), jnp.ones((pushes, 2))
    return Still(each, each, each, jnp.ones(pushes), place, place)


def all_finite(figures: dict, *, but: tuple[str, ...] = ()) -> bool:
    return all(math.isfinite(v) and v > 0 for k, v in figures.items() if k not in but)


def test_engines_reports_the_documented_figures():
    figures = load_case("engines")(2, batch=6, steps=60)
    assert set(figures) == {
        "planar_scene_steps_per_s",
        "bullet_scene_steps_per_s",
        "bullet_ratio",
        "batch",
        "steps",
        "devices",
        "runs",
    }
    bullet = ("bullet_scene_steps_per_s", "bullet_ratio")
    assert all_finite(figures, but=() if find_spec("pybullet") else bullet)
    sizes = [figures[name] for name in ("batch", "steps", "devices", "runs")]
    assert sizes == [6, 60, jax.device_count(), 2]
    json.dumps(figures, allow_nan=False)


def watch_starts(monkeypatch) -> list[set[tuple[str, int]]]:
    """Return what each start will have left in its cache: programs, and when."""
    run, kept = subprocess.run, []

    def watched(command: list[str], **how) -> None:
        run(command, **how)
        cache = Path(how["env"]["JAX_COMPILATION_CACHE_DIR"])
        kept.append({(e.name, e.stat().st_mtime_ns) for e in cache.iterdir()})

    monkeypatch.setenv("XLA_FLAGS", "")  # what users compile is worth keeping
    monkeypatch.setattr("sainet.bench.planning.subprocess.run", watched)
    return kept


@pytest.mark.slow
def test_planning_reports_the_documented_figures(monkeypatch):
    kept = watch_starts(monkeypatch)
    figures = load_case("planning")(2, model="physics")
    wanted = ("full_tree_s", "greedy_s", "evaluated", "bullet_push_s", "bullet_ratio")
    wanted += ("cold_start_s", "warm_start_s", "decisions", "devices")
    assert tuple(figures) == wanted
    bullet = ("bullet_push_s", "bullet_ratio")
    assert all_finite(figures, but=() if find_spec("pybullet") else bullet)
    assert figures["evaluated"] == 72 + 72**2
    # Times of a busy machine prove nothing; what the second start compiled does.
    cold, warm = kept
    searches = [
        {name for name, _ in compiled if name.startswith("jit_over_devices")}
        for compiled in (cold, warm - cold)
    ]
    assert searches[0]
    assert not searches[1]
    json.dumps(figures, allow_nan=False)


@pytest.mark.slow
def test_disks_reports_the_documented_figures():
    figures = load_case("disks")(1, counts=(3,))
    wanted = ("engine_step_us_3", "network_step_us_3", "tree_s_3")
    assert tuple(figures) == (*wanted, "devices", "runs")
    assert all_finite(figures)
    json.dumps(figures, allow_nan=False)


def test_screening_reports_the_documented_figures(monkeypatch):
    few = partial(TreePlanner, actions=PushGrid(contact_bins=5, direction_bins=4))
    monkeypatch.setattr("sainet.bench.screening.TreePlanner", few)
    monkeypatch.setattr("sainet.bench.screening.DECISIONS", 2)
    figures = load_case("screening")(1, models=("sain-any",), disks=(2,))
    wanted = ("screened_s", "unscreened_s", "same_first_push")
    assert tuple(figures) == (
        *(f"sain-any_2_{x}" for x in wanted),
        "decisions",
        "devices",
    )
    assert figures["sain-any_2_same_first_push"] in (0, 0.5, 1)
    assert all_finite(figures)


@pytest.mark.slow
def test_environments_reports_the_documented_figures():
    figures = load_case("environments")(1, worlds=3)
    wanted = ("vector_pushes_per_s", "bullet_pushes_per_s", "bullet_ratio")
    assert tuple(figures) == (*wanted, "worlds", "processes", "runs", "reason")
    is_measured = bool(find_spec("gymnasium") and find_spec("pybullet"))
    assert all_finite(figures, but=("reason",) if is_measured else (*wanted, "reason"))
    assert (figures["reason"] is None) == is_measured
    json.dumps(figures, allow_nan=False)


@pytest.mark.slow
def test_start_reports_the_documented_figures(monkeypatch):
    monkeypatch.setattr(start_case, "SCRIPT", "import sainet")
    others = ("--model", "physics", "--port", "0")
    monkeypatch.setattr(start_case, "PLAY", (*start_case.PLAY, *others))
    figures = load_case("start")(1, pointers=2)
    wanted = ("play_cold_s", "play_warm_s", "pointer_ms")
    scripts = ("script_cold_s", "script_warm_s")
    assert tuple(figures) == (*wanted, *scripts, "pointers", "runs", "reason")
    assert all_finite(figures, but=("reason",))
    assert figures["play_warm_s"] > figures["pointer_ms"] / 1000 > 0


def test_a_page_that_does_not_start_is_no_figure(monkeypatch, tmp_path):
    monkeypatch.setattr(start_case, "PLAY", ("-c", "print('no page')"))
    with pytest.raises(BadInput, match="it ended at once"):
        start_case._page(tmp_path, 1)


@pytest.mark.slow
def test_training_reports_the_documented_figures():
    figures = load_case("training")(2, pushes=3, steps=4, repeats=1)
    assert set(figures) == {
        "iteration_ms",
        "ceiling_gflops",
        "ceiling_fraction",
        "eager_torch_ratio",
        "work_gflop",
        "devices",
        "runs",
        "reason",
    }
    assert figures["reason"] == missing_torch()
    has_torch = figures["reason"] is None
    assert (figures["eager_torch_ratio"] is not None) == has_torch
    absent = "reason" if has_torch else "eager_torch_ratio"
    assert all_finite(figures, but=("reason", absent))
    network = network_of("robot", augmented=True)
    assert figures["work_gflop"] == counted_gflop(network, 3, 4, 2)
    json.dumps(figures, allow_nan=False)


def test_every_figure_is_the_median_of_paired_measurements():
    measured = [
        training_case.Measurement(100.0, 50.0, 100.0),
        training_case.Measurement(200.0, 20.0, 100.0),
        training_case.Measurement(50.0, 40.0, 160.0),
    ]
    assert training_case._figures(measured, 1.0) == {
        "iteration_ms": 40.0,
        "ceiling_gflops": 100.0,
        "ceiling_fraction": pytest.approx(0.25),  # of 0.2, 0.25 and 0.5
        "eager_torch_ratio": pytest.approx(4.0),  # of 2, 5 and 4
    }


def test_the_median_ignores_the_warm_up_and_one_outlier():
    naps = iter([0.2, 0.01, 0.3, 0.01, 0.01])
    assert 0.01 <= median_seconds(lambda: time.sleep(next(naps)), 4) < 0.15
    assert next(naps, None) is None


def test_the_ceiling_is_a_plausible_rate():
    assert 0.1 < ceiling_gflops(2) < 1e6


def test_an_unknown_case_lists_the_available_cases():
    every = "disks, engines, environments, planning, screening, start, training"
    with pytest.raises(UnknownName, match=f"'trainin'.*{every}"):
        load_case("trainin")


@pytest.mark.parametrize("name", CASES)
def test_a_case_without_runs_is_bad_input(name):
    with pytest.raises(BadInput, match="`runs` is 0"):
        load_case(name)(0)


def test_figures_of_several_cases_are_separate_objects(monkeypatch):
    ran, alone = [], {"bullet_ratio": 2.0}

    def slow_case(runs=5):
        ran.append(runs)
        return alone

    monkeypatch.setattr("sainet.cli.bench.use_devices", lambda count: None)
    for case in ("engines", "planning"):
        monkeypatch.setattr(f"sainet.bench.{case}.bench_{case}", slow_case)
    quiet = Output(quiet=True)
    found = Bench(cases=("engines", "planning"), output=quiet).run()
    assert found == {"engines": alone, "planning": alone}
    assert Bench(cases=("planning",), output=quiet).run() == alone
    with pytest.raises(UnknownName, match="plannin"):
        Bench(cases=("engines", "plannin"), output=quiet).run()
    assert ran == [5] * 3  # nothing is measured when a name is wrong
    Bench(cases=("planning",), runs=2, output=quiet).run()
    assert ran[-1] == 2
    with pytest.raises(BadInput, match="`runs` is 0"):
        Bench(cases=("commands",), runs=0, output=quiet).run()


def test_whole_commands_run_to_their_end_in_a_folder_of_their_own(tmp_path):
    found = bench_commands(2, ("sainet --help", "sainet generate --help"))
    assert found.pop("runs") == 2
    assert len(found) == 2 and all(seconds > 0.01 for seconds in found.values())
    failing = f"sainet report {tmp_path / 'nothing'}"
    with pytest.raises(SainetError, match="it failed; repair") as caught:
        bench_commands(1, (failing,))
    assert str(caught.value).startswith(f"{failing}: ")
    assert "\n" not in str(caught.value)
    with pytest.raises(BadInput, match="runs` is 0"):
        bench_commands(0)


def test_listing_the_cases_does_not_import_jax():
    code = "import sys, sainet.bench; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


class Trained(NamedTuple):
    problem: Problem
    losses: list[float]


@pytest.fixture(scope="module")
def trained() -> Trained:
    problem = make_problem(5, 20)
    loop = TrainingLoop(problem)
    later = [float(loop.advance()[1]) for _ in range(2)]
    return Trained(problem, [loop.first_loss, *later])


def test_the_timed_loop_trains(trained: Trained):
    assert sorted(trained.losses, reverse=True) == trained.losses


# PyTorch is no dependency: these skip even where SAINET_REQUIRE_ALL=1.
needs_torch = pytest.mark.skipif(
    missing_torch() is not None, reason=str(missing_torch())
)


@needs_torch
def test_torch_computes_the_same_losses_and_steps(trained: Trained, tmp_path: Path):
    path = save_problem(tmp_path / "problem.npz", trained.problem)
    result = run_torch(path, 2)
    # The later ones hold the gradient, its clipping and Adam against each other.
    assert result.losses[0] == pytest.approx(trained.losses[0], rel=1e-5)
    assert list(result.losses) == pytest.approx(trained.losses, rel=3e-5)
    assert result.iteration_ms > 0


@needs_torch
def test_a_failing_peer_reports_its_error(tmp_path: Path):
    with pytest.raises(SainetError, match="absent.npz"):
        run_torch(tmp_path / "absent.npz", 1)


@pytest.mark.parametrize("loss", [1.01, 0.99, math.nan])
def test_a_peer_with_another_first_loss_is_refused(loss, monkeypatch):
    result = TorchRun((loss,), iteration_ms=7.0)
    monkeypatch.setattr("sainet.bench.training.run_torch", lambda *_: result)
    with pytest.raises(SainetError, match="same work"):
        TorchPeer(Path("problem.npz"), 1.0).iteration_ms()


def test_a_peer_may_differ_by_rounding(monkeypatch):
    result = TorchRun((1.0005,), iteration_ms=7.0)
    monkeypatch.setattr("sainet.bench.training.run_torch", lambda *_: result)
    assert TorchPeer(Path("problem.npz"), 1.0).iteration_ms() == 7.0


def test_a_missing_environment_gives_a_remedy(monkeypatch, tmp_path):
    monkeypatch.setattr("sainet.bench.training.FOLDER", tmp_path)
    assert "make torch-env" in str(missing_torch())
