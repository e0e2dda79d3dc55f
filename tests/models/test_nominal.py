"""Nominal inputs: a network cannot tell true masses and radii from assumed ones."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from models.samples import Glide, pushes
from sainet.models.checkpoint import features_of
from sainet.models.correctors.interaction import InteractionNetwork
from sainet.models.dynamics import LearnedDynamics, SimulatorAugmented, predict
from sainet.models.inputs import push_frame
from sainet.scenes.scene import TIME_STEP


def network(features, *, simulator=False):
    found = features_of(
        features, "robot", simulator=simulator, time_step=TIME_STEP, disks=2
    )
    return InteractionNetwork(found, time_step=TIME_STEP, key=jax.random.key(0))


def ends(model, scene, push):
    return np.asarray(predict(model, scene, *push).final.position)


@pytest.mark.parametrize("features", ["paper", "nominal"])
@pytest.mark.parametrize("around", [None, Glide()])
def test_only_an_engine_responds_to_true_properties(features, around):
    scene, *push = pushes("robot", 3)
    other = replace(scene, mass=1.2 * scene.mass, radius=0.99 * scene.radius)
    made = network(features, simulator=around is not None)
    model = SimulatorAugmented(made, around) if around else LearnedDynamics(made)
    one, two = ends(model, scene, push), ends(model, other, push)
    is_blind = features == "nominal" and around is None
    assert np.array_equal(one, two) == is_blind


def test_the_third_disk_is_the_mean_of_the_assumed_ones():
    scene, initial, _ = pushes("robot", 3)
    still = network("nominal").features.still(scene, push_frame(scene, initial))
    np.testing.assert_allclose(still.mass[0], [0.896, 1.1, 0.998], rtol=1e-6)
    np.testing.assert_allclose(still.radius[0], [0.0525, 0.058, 0.05525], rtol=1e-6)
    paper = network("paper")
    assert paper.features != network("nominal").features
    assert paper.features.blocks == network("nominal").features.blocks
