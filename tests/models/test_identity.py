"""Names of models, computed from what they are."""

import pytest

from sainet.engines.simulator import SIMULATORS, Assumptions, PlanarSpec
from sainet.models.identity import ModelId

PLANAR, BULLET = SIMULATORS["planar"], SIMULATORS["bullet"]
FITTED = PlanarSpec(assumptions=Assumptions(pusher_friction=0.2))


@pytest.mark.parametrize(
    ("identity", "slug", "label"),
    [
        (ModelId(kind="physics", simulator=PLANAR), "physics", "Physics"),
        (ModelId(kind="physics", simulator=BULLET), "physics", "Physics"),
        (
            ModelId(kind="physics", simulator=SIMULATORS["bullet-true"]),
            "physics-true",
            "Physics, true properties",
        ),
        *(
            (ModelId(kind="physics", simulator=SIMULATORS[name]), slug, label)
            for name, slug, label in (
                ("planar-overlap", "physics-overlap", "Physics, overlaps kept"),
                (
                    "planar-true-overlap",
                    "physics-true-overlap",
                    "Physics, true properties, overlaps kept",
                ),
            )
        ),
        (ModelId(kind="in"), "in", "IN"),
        (ModelId(kind="in", data="stroke"), "in-stroke", "IN, stroke"),
        (ModelId(kind="sain", simulator=PLANAR), "sain", "SAIN"),
        (ModelId(kind="sain", simulator=BULLET), "sain-bullet", "SAIN around Bullet"),
        (
            ModelId(kind="sain", simulator=FITTED, data="residual", features="place"),
            "sain-identified-residual-place",
            "SAIN, identified, residual, place",
        ),
        *(
            (ModelId(kind="sain", simulator=SIMULATORS[name]), slug, label)
            for name, slug, label in (
                ("planar-true", "sain-true", "SAIN, true properties"),
                ("planar-overlap", "sain-overlap", "SAIN, overlaps kept"),
                (
                    "bullet-true",
                    "sain-bullet-true",
                    "SAIN around Bullet, true properties",
                ),
            )
        ),
        (
            ModelId(kind="physics", simulator=SIMULATORS["bullet-true"]),
            "physics-true",
            "Physics, true properties",
        ),
        (
            ModelId(kind="sain", simulator=PLANAR, variant="single-steps"),
            "sain-single-steps",
            "SAIN, single steps",
        ),
        (ModelId(kind="sain", simulator=PLANAR, name="my-own"), "my-own", "my-own"),
    ],
)
def test_names_follow_from_the_fields(identity: ModelId, slug: str, label: str):
    assert (identity.slug, identity.label) == (slug, label)


def test_fields_that_are_unset_are_not_in_representations():
    """Run folders are named by them, and keep their names when a field is added."""
    usual = repr(ModelId(kind="sain", simulator=PLANAR))
    assert "abstains" not in usual
    assert "keeps_overlaps" not in usual
    other = ModelId(kind="sain", simulator=SIMULATORS["planar-overlap"]).abstaining
    assert "abstains=True" in repr(other)
    assert "keeps_overlaps=True" in repr(other)
