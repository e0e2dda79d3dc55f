"""A recording checks its clock."""

import numpy as np
import pytest

from sainet.runs.errors import BadInput
from sainet.scenes.recording import Recording


def recording(time=(0.0, 0.1), bodies=1) -> Recording:
    return Recording(
        time=np.array(time),
        pose=np.zeros((2, bodies, 3)),
        pusher=np.zeros((2, 2)),
        source="pushes.csv: push a",
    )


def test_a_recording_counts_its_disks():
    assert recording(bodies=3).bodies == 3


@pytest.mark.parametrize("time", [(0.1, 0.1), (0.2, 0.1), (0.0, np.nan)])
def test_times_that_do_not_increase_are_refused(time: tuple):
    with pytest.raises(BadInput, match="pushes.csv: push a: time must increase"):
        recording(time=time)
