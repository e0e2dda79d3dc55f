"""Simulator specifications: documents that build engines."""

import msgspec
import pytest

from sainet.engines.simulator import (
    SIMULATORS,
    Assumptions,
    PlanarSpec,
    SimulatorSpec,
    simulator_named,
)
from sainet.runs.errors import UnknownName

IDENTIFIED = PlanarSpec(
    assumptions=Assumptions(pusher_friction=0.2), pressure_radius_ratio=0.5
)


@pytest.mark.parametrize("spec", [*SIMULATORS.values(), IDENTIFIED])
def test_a_specification_survives_its_document(spec: SimulatorSpec):
    text = msgspec.json.encode(spec)
    assert msgspec.json.decode(text, type=SimulatorSpec) == spec


def test_slugs_differ_where_specifications_do():
    other = PlanarSpec(assumptions=Assumptions(pusher_friction=0.21))
    slugs = [spec.slug for spec in (*SIMULATORS.values(), IDENTIFIED, other)]
    assert len(set(slugs)) == len(slugs)
    assert slugs[:2] == ["planar", "planar-true"]
    assert [spec.is_identified for spec in (SIMULATORS["bullet"], other)] == [
        False,
        True,
    ]


def test_the_built_engine_has_the_parameters():
    built = IDENTIFIED.build()
    assert built.engine.pressure_radius_ratio == IDENTIFIED.pressure_radius_ratio
    assert built.assumptions == IDENTIFIED.assumptions


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ('{"engine":"planar","pressure_radius_ratio":50}', "pressure_radius_ratio"),
        ('{"engine":"planar","assumptions":{"mass":[1e-46]}}', "mass"),
        ('{"engine":"planar","assumptions":{"table_friction":1e30}}', "table_friction"),
        ('{"engine":"pinball"}', "engine"),
    ],
)
def test_impossible_values_are_refused_with_their_field(text: str, field: str):
    with pytest.raises(msgspec.ValidationError, match=field):
        msgspec.json.decode(text, type=SimulatorSpec)


def test_an_unknown_name_lists_the_available_names():
    with pytest.raises(UnknownName, match="planar-true"):
        simulator_named("planar-exact")
