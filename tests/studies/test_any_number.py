"""Contact networks for any number of disks: what is trained, and tested on what."""

import pytest
from msgspec import structs

from sainet.studies import load_study
from sainet.studies.any_number import (
    ASSUMED,
    CONTACTS,
    OVERLAP,
    TrainMixture,
)
from sainet.studies.runner import all_steps
from sainet.studies.steps import Evaluate, Simulate, Train
from sainet.studies.study import Scope, last_steps


@pytest.mark.parametrize(
    ("name", "network", "disks"),
    [
        ("any-number", CONTACTS, {2, 3, 5, 8}),
        ("any-number-assumed", ASSUMED, {2, 3, 5}),
        ("any-number-assumed", OVERLAP, {2, 3, 5}),
    ],
)
def test_networks_of_two_disks_are_tested_on_more(name, network, disks):
    plan = load_study(name).plan(Scope("paper"))
    steps = list(all_steps(last_steps([plan])).values())
    trained = [each for each in steps if isinstance(each, Train) and each.id == network]
    assert sorted(each.recipe.seed for each in trained) == [0, 1, 2, 3, 4]
    (pushes,) = {each.pushes for each in trained}
    assert isinstance(pushes, Simulate)
    assert pushes.config.disks == 2
    assert {"planar", "planar-true"} == set(pushes.config.assumed_engine)
    tests = [each.pushes.config for each in steps if isinstance(each, Evaluate)]
    assert {each.disks for each in tests} == disks
    assert pushes.config.seed not in {each.seed for each in tests}
    assert len({(each.disks, each.arrangement) for each in tests}) == len(tests)


@pytest.mark.parametrize(
    ("name", "network", "hold", "iterations"),
    [
        ("any-number", CONTACTS, 8, 1200),
        ("any-number-assumed", ASSUMED, 1, 1200),
        ("any-number-assumed", OVERLAP, 1, 3600),
    ],
)
def test_mixed_networks_are_trained_on_one_to_four_disks(
    name, network, hold, iterations
):
    network = structs.replace(network, variant="one-to-four")
    plan = load_study(name).plan(Scope("paper"))
    steps = all_steps(last_steps([plan])).values()
    trained = [each for each in steps if isinstance(each, Train) and each.id == network]
    assert sorted(each.recipe.seed for each in trained) == [0, 1, 2, 3, 4]
    for each in trained:
        assert isinstance(each, TrainMixture)
        disks = [pushes.config.disks for pushes in (each.pushes, *each.more)]
        assert disks == [1, 2, 3, 4]
        assert each.recipe.horizon.hold == hold
        assert each.recipe.optimiser.iterations == iterations
