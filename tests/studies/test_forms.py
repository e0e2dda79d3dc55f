"""Studies at reduced size: their plans, and pushes of fixed properties."""

from dataclasses import replace

import numpy as np
import pytest

from sainet.datasets.fixed import FixedConfig
from sainet.datasets.generate import store_info
from sainet.runs.errors import BadSetting
from sainet.studies import load_study
from sainet.studies.reduced_setup import SIZES, TRAININGS
from sainet.studies.steps import Evaluate, Join, Simulate, Train
from sainet.studies.study import Scope
from sainet.worlds.sampling import chunk_generator, draw


def parts(name, scale="paper"):
    """The evaluations of a study, and its networks by folder name."""
    plan = load_study(name).plan(Scope(scale))
    joined = plan.measured
    found = joined.parts if isinstance(joined, Join) else (joined,)
    assert all(isinstance(each, Evaluate) for each in found)
    networks = [m for each in found for m in each.models if isinstance(m, Train)]
    return found, {each.folder_name: each for each in networks}


def slugs(part):
    return list(dict.fromkeys(model.id.slug for model in part.models))


@pytest.mark.parametrize("scale", ["quick", "paper"])
@pytest.mark.parametrize(
    "name", ["feedforward", "varied-or-fixed", "crossed-properties"]
)
def test_each_network_is_trained_as_its_identity_says(name, scale):
    found, networks = parts(name, scale)
    for network in networks.values():
        assert network.recipe.features == network.id.features
        assert network.iterations == SIZES[scale].iterations
        assert isinstance(network.pushes, Simulate)
        config, is_fixed = network.pushes.config, "fixed" in network.id.variant
        assert isinstance(config, FixedConfig) == is_fixed
        assert config.disks == (3 if network.id.variant == "three-disks" else 2)
        internal = network.id.simulator
        if internal is not None:
            assert internal.stored_as in store_info(config).assumed_engines
        assert "planar" in config.assumed_engine
    runs = TRAININGS if scale == "paper" else 1
    assert len(networks) == len({n.id for n in networks.values()}) * runs
    tests = {part.pushes.config.seed for part in found}
    assert tests.isdisjoint(n.pushes.config.seed for n in networks.values())


def test_feedforward_networks_predict_only_what_they_take():
    (two, three), _ = parts("feedforward")
    known = ["physics", "physics-true", "in", "sain-bullet"]
    of_two = ["in-whole-state", "sain-bullet-whole-state"]
    assert slugs(two) == known + of_two
    assert slugs(three) == known + [f"{slug}-three-disks" for slug in of_two]
    labels = {model.id.label for model in (*two.models, *three.models)}
    assert labels >= {
        "Feedforward",
        "SA feedforward around Bullet",
        "Feedforward, 3 disks",
        "SA feedforward around Bullet, 3 disks",
    }


def test_properties_are_crossed():
    (varied, fixed), _ = parts("varied-or-fixed")
    assert slugs(varied) == slugs(fixed)
    assert isinstance(fixed.pushes.config, FixedConfig)
    (crossed,), _ = parts("crossed-properties")
    engines = ["in", "sain-bullet", "sain-bullet-true"]
    nominal = [f"{slug}-nominal" for slug in engines]
    assert slugs(crossed) == ["physics", "physics-true", *engines, *nominal]
    assert {m.id.simulator.slug for m in crossed.models if m.id.kind == "sain"} == {
        "bullet",
        "bullet-true",
    }


def test_studies_share_their_training_runs():
    runs = [parts(name)[1] for name in ("feedforward", "varied-or-fixed")]
    crossed = parts("crossed-properties")[1]
    shared = runs[0].keys() & runs[1].keys() & crossed.keys()
    assert {crossed[name].id.slug for name in shared} == {"in", "sain-bullet"}
    assert len(shared) == 2 * TRAININGS


def test_fixed_properties_are_those_of_the_papers_disks():
    drawn = draw(FixedConfig(), chunk_generator(0, 0), 3)
    assert drawn.mass.tolist() == [[0.896, 1.1]] * 3
    np.testing.assert_allclose(drawn.radius, [[0.0525, 0.058]] * 3)
    assert drawn.table_friction.tolist() == [0.15] * 3
    with pytest.raises(BadSetting, match="`mass_of_each_kg` is .* 3 numbers"):
        FixedConfig(disks=3)
    with pytest.raises(BadSetting, match="`radius_of_each_mm`"):
        replace(FixedConfig(), radius_of_each_mm=(0.05, 0.06))
