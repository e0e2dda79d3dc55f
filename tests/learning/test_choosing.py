"""The next pushes: where predictions are least certain, not where pushes are."""

import json

import numpy as np
import pytest

from sainet.cli.entry import run
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.engines.simulator import SIMULATORS, InternalEngine
from sainet.learning.choosing import choose_pushes
from sainet.learning.process import fit_process
from sainet.models.fitted_process import Fitted
from sainet.models.process_card import ProcessSettings

NOISE = 0.1


def fitted_at(points, length=0.5):
    """A process of one body, whose outputs are alike, fitted at some points."""
    points, outputs = np.atleast_2d(points), 3
    alike = np.ones(outputs)
    return Fitted(
        inputs=points,
        outputs=np.zeros((outputs, len(points))),
        amplitude=alike,
        length=np.full((outputs, points.shape[1]), length),
        noise=NOISE * alike,
        mean=0 * alike,
        scale=alike,
        share=alike,
        centre=np.zeros(points.shape[1]),
        width=np.ones(points.shape[1]),
        errors=np.ones((len(points), 1, 2)),
        near=np.ones((1, 2, points.shape[1])),
        reach=np.ones((1, 2)),
        plain=np.ones((1, 2)),
    )


def variance_after(points, possible, length=0.5):
    """Mean posterior variance by the textbook, with a push at each of the points."""

    def kernel(one, other):
        r = np.sqrt(3) * np.abs(one[:, None, 0] - other[None, :, 0]) / length
        return (1 + r) * np.exp(-r)

    own = kernel(points, points) + NOISE * np.eye(len(points))
    across = kernel(points, possible)
    return np.mean(1 - np.sum(across * np.linalg.solve(own, across), axis=0))


@pytest.fixture
def possible():
    return np.random.default_rng(0).uniform(-2, 2, (40, 1))


def test_each_choice_leaves_least_variance_of_all(possible):
    seen = np.array([[-2.0], [0.5]])
    chosen, left = choose_pushes(fitted_at(seen), possible, 3)
    before, known = variance_after(seen, possible), seen
    for row, share in zip(chosen, left, strict=True):
        every = [
            variance_after(np.vstack([known, each]), possible) for each in possible
        ]
        assert np.argmin(every) == row
        known = np.vstack([known, possible[row]])
        assert share == pytest.approx(
            variance_after(known, possible) / before, rel=1e-4
        )


def test_no_push_is_chosen_twice_and_variance_falls(possible):
    chosen, left = choose_pushes(fitted_at([[0.0]]), possible, len(possible))
    assert sorted(chosen) == list(range(len(possible)))
    assert (np.diff([1.0, *left]) < 0).all()


def test_chosen_pushes_are_far_from_those_that_were_made():
    possible = np.array([[0.0], [0.1], [3.0]])
    chosen, _ = choose_pushes(fitted_at([[0.0], [0.05], [0.1]]), possible, 1)
    assert chosen.tolist() == [2]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A process of simulated pushes of one disk, and the dataset."""
    out = tmp_path_factory.mktemp("chosen")
    config = GenerateConfig(
        pushes=24, disks=1, stroke_mm=(5.0,), hold_steps=4, noise_level="none", seed=2
    )
    store = generate(config, out / "data")
    settings = ProcessSettings(features="side", iterations=5, folds=2)
    internal = InternalEngine(SIMULATORS["planar"])
    fit_process(store.first(12), out / "gp", internal, settings)
    return out


def test_the_command_proposes_pushes_in_the_range_of_the_fit(folder, capsys):
    assert run(["propose", str(folder / "gp"), "--count", "3", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["pushes"]
    left = [push["variance_left_percent"] for push in found]
    assert len(found) == 3
    assert sorted(left, reverse=True) == left
    assert left[0] < 100
    assert all(-180 <= push["contact_normal_deg"] <= 180 for push in found)
    assert all(abs(push["direction_deg"]) < 45 for push in found)


def test_the_command_chooses_from_a_pool(folder, capsys):
    words = ["propose", str(folder / "gp"), "--pool", str(folder / "data"), "--json"]
    assert run([*words, "--count", "4"]) == 0
    found = json.loads(capsys.readouterr().out)["pushes"]
    rows = [push["row"] for push in found]
    assert len(set(rows)) == 4
    assert set(rows) <= set(range(24))
    assert sum(row >= 12 for row in rows) >= 2  # rather those that are new


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--count", "0"], "count"),
        (["--count", "9999"], "only 1024 pushes are possible"),
        (["--pool", "nowhere"], "nowhere"),
    ],
)
def test_bad_input_ends_in_one_line(folder, options, message, capsys):
    assert run(["propose", str(folder / "gp"), *options]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert error.count("\n") == 0


def test_a_folder_without_a_process_is_refused(folder, capsys):
    assert run(["propose", str(folder / "data")]) == 2
    says = f"{folder / 'data'}: not a Gaussian process of 'sainet tune gp'."
    assert capsys.readouterr().err == f"sainet: {says}\n"
