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
