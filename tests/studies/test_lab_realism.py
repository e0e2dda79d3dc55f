"""Recorded pushes, repeated in a virtual lab."""

import numpy as np
from msgspec import structs

from learning.stores import end_points_alone, write
from sainet.datasets.config import GenerateConfig
from sainet.datasets.generate import generate
from sainet.datasets.schema import variables
from sainet.studies.lab_realism import Repeat
from sainet.studies.runner import Runner
from sainet.studies.steps import Given


def test_a_repeated_push_ends_near_the_recorded_one_and_not_at_it(tmp_path):
    config = GenerateConfig(
        disks=1,
        pushes=6,
        engine="planar",
        mass_kg=(0.896,),
        radius_mm=(52.5,),
        stroke_mm=(20.0,),
        speed_mm_s=(50.0,),
        noise_level="none",
    )
    made = generate(config, tmp_path / "made")
    info = structs.replace(
        made.info, engine="recorded", seed=None, has_measurements=False
    )
    arrays = made.read(slice(None), tuple(variables(info)))
    recorded = write(tmp_path / "recorded", info, end_points_alone(arrays))
    runner = Runner(tmp_path / "steps")
    found = {
        number: runner.result(Repeat(Given(recorded), number, "abs")).read(
            slice(None), ("truth", "initial", "steps")
        )
        for number in (0, 1)
    }
    truth = recorded.read(slice(None), ("truth",))["truth"]
    rows, last = np.arange(6), found[0]["steps"] - 1
    ends = [each["truth"][rows, last, 0, :3] for each in found.values()]
    wanted = truth[rows, last, 0, :3]
    for end in ends:
        away = np.linalg.norm((end - wanted)[:, :2], axis=-1)
        assert 1e-4 < away.mean() < 3e-3
        assert np.abs(end - wanted)[:, 2].max() < np.deg2rad(15)
    assert np.abs(ends[0] - ends[1])[:, :2].max() > 1e-4
    assert np.isnan(found[0]["truth"][:, :-1]).all()
