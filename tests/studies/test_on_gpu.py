"""On a GPU a runner trains networks at once that are alike."""

import pytest

from learning.stores import quiet_store
from sainet.learning import together as together_module
from sainet.learning.recipes import PAPER
from sainet.models.card import CARD
from sainet.studies import on_gpu
from sainet.studies.on_gpu import train_alike
from sainet.studies.paper_setup import IN, SAIN
from sainet.studies.runner import Runner
from sainet.studies.steps import Evaluate, First, Given, Train

RECIPE = PAPER.changed(iterations=4, batch_size=8, log_every=2)


@pytest.fixture(scope="session")
def store(tmp_path_factory):
    return quiet_store(tmp_path_factory.getbasetemp())


@pytest.fixture
def groups(monkeypatch):
    """How many networks began to train at once, each time."""
    found, fit_together = [], on_gpu.fit_together

    def note(jobs, on_step):
        found.append(len(jobs))
        fit_together(jobs, on_step)

    monkeypatch.setattr(on_gpu, "fit_together", note)
    return found


def test_networks_that_differ_in_seed_l2_or_data_train_at_once(store, tmp_path, groups):
    pushes, tests = Given(store), Given(store)
    few = First(pushes, 16)
    networks = [
        Train(SAIN, pushes, RECIPE),
        Train(SAIN, pushes, RECIPE.changed(seed=1)),
        Train(SAIN, pushes, RECIPE.changed(l2=1e-3)),
        Train(SAIN, few, RECIPE),
        Train(SAIN, pushes, RECIPE.changed(learning_rate=1e-4)),
        Train(IN, pushes, RECIPE),
    ]
    last = Evaluate(tuple(networks), tests)
    runner = Runner(tmp_path, ahead=(last,), together=train_alike)
    for network in networks:
        runner.result(network)
        if network is networks[0]:  # those that are alike are finished with it
            finished = [(runner.folder(each) / CARD).is_file() for each in networks]
            assert finished == [True] * 4 + [False] * 2
    assert groups == [4]  # and two trained alone


def test_networks_of_one_step_are_left_to_train_alone(store, tmp_path, groups):
    first = Train(SAIN, Given(store), RECIPE)
    tuned = Train(SAIN, Given(store), RECIPE.changed(seed=1), start=first)
    runner = Runner(tmp_path, ahead=(tuned,), together=train_alike)
    runner.result(tuned)
    assert groups == []


def test_an_interrupt_ends_all_of_them(store, tmp_path, monkeypatch):
    def stop():
        raise KeyboardInterrupt

    networks = [
        Train(SAIN, Given(store), RECIPE.changed(seed=seed)) for seed in range(2)
    ]
    last = Evaluate(tuple(networks), Given(store))
    runner = Runner(tmp_path, ahead=(last,), together=train_alike)
    with monkeypatch.context() as patch:
        patch.setattr(together_module, "raise_if_interrupted", stop)
        with pytest.raises(KeyboardInterrupt):
            runner.result(networks[0])
    again = Runner(tmp_path, ahead=(last,), together=train_alike)
    assert again.result(networks[0]).card.final_loss is not None
