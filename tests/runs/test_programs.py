"""Compiled programs are forgotten before a process has no room for their maps."""

import jax
import jax.numpy as jnp
import pytest

from sainet.runs import programs, workers


@pytest.fixture
def maps(tmp_path, monkeypatch):
    """A process with so many memory maps as this file has lines."""
    path = tmp_path / "maps"
    monkeypatch.setattr(programs, "_MAPS", path)
    monkeypatch.setattr(programs, "_MOST_MAPS", 3)
    return path


@jax.jit
def doubled(x):
    return 2 * x


@pytest.mark.parametrize(("count", "kept"), [(3, 1), (4, 0)])
def test_programs_are_forgotten_where_there_are_many_maps(maps, count, kept):
    maps.write_text("7fac138eb000-7fac138ec000 r-xp\n" * count)
    doubled(jnp.ones(3))
    programs.make_room()
    assert doubled._cache_size() == kept


def test_every_job_of_a_worker_makes_room(maps):
    maps.write_text("map\n" * 4)
    doubled(jnp.ones(3))
    with pytest.raises(ZeroDivisionError):
        workers._do(divmod, 1, 0)
    assert doubled._cache_size() == 0


def test_a_system_without_maps_is_left_alone(maps):
    doubled(jnp.ones(3))
    programs.make_room()
    assert doubled._cache_size() == 1
