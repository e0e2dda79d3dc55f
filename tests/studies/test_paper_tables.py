"""Tiny studies with Bullet: their rows and their shared datasets and networks."""

from collections import Counter
from importlib.util import find_spec

import numpy as np
import pytest

from sainet.datasets.store import open_store
from sainet.evaluation.summary import Estimate, Row, Summary
from sainet.models.card import read_card
from sainet.runs.documents import read_json
from sainet.studies.data_efficiency import IN_FULL, of_pushes_again
from sainet.studies.paper_setup import NETWORKS
from sainet.studies.paper_tables import PUBLISHED_DIRECT_FORCE_THREE_DISKS
from sainet.studies.robustness import push_angles
from sainet.studies.study import STEPS
from sainet.studies.variants import score
from support import require

pytestmark = pytest.mark.slow
PHYSICS = {"physics", "physics-true"}


@pytest.fixture(autouse=True)
def bullet():
    require(find_spec("pybullet"), "PyBullet is not installed")


def cards(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("card.json")}


def without_hash(card):
    return card.parent.name.rpartition("-")[0]


def rows_of(table):
    return {(row["group"], row["model"], row["body"]) for row in table["rows"]}


def test_tables_of_one_setup_share_data_and_networks(make, tmp_path):
    two = make("direct-force-two-disks")
    made = cards(tmp_path)
    three = make("direct-force-three-disks")
    assert len(made) == len(NETWORKS)
    after = cards(tmp_path)
    assert {path: after[path] for path in made} == made
    beside, usual = {"sain-bystander"}, {network.slug for network in NETWORKS}
    added = after.keys() - made.keys()
    assert {without_hash(path) for path in added} == {"sain-bystander-seed-0"}
    for disks, table, more in (
        (2, two, set()),
        (3, three, beside),
        (2, three["as_trained"], beside),
    ):
        models, bodies = PHYSICS | usual | more, range(1, disks + 1)
        assert rows_of(table) == {(None, m, b) for m in models for b in bodies}
        assert all(row["n"] == 4 for row in table["rows"])
    (old,) = (path for path in made if without_hash(path) == "sain-seed-0")
    old, new = map(read_json, (old, *added))
    assert new["started_from"] == old["weights"]
    assert new["identity"] == old["identity"]
    published = {row["model"]: [] for row in three["published"]}
    for row in three["published"]:
        published[row["model"]].append(row["pos_mm"])
    assert published == {
        each.model.slug: list(each.values["pos_mm"])
        for each in PUBLISHED_DIRECT_FORCE_THREE_DISKS
    }
    made_by = read_json(tmp_path / "direct-force-three-disks" / "config.json")
    assert made_by["study"] == "direct-force-three-disks"
    versions = read_json(tmp_path / "direct-force-three-disks" / "manifest.json")
    assert versions["versions"]["jax"]
    engines = {
        internal.simulator.slug if internal else None
        for internal in (read_card(path.parent).internal for path in made)
    }
    assert engines == {None, "bullet", "planar", "planar-true"}


def test_studies_of_the_robot_setup_share_networks(make, tmp_path):
    models = PHYSICS | {"in"}
    efficiency = make("data-efficiency")
    assert rows_of(efficiency) == {
        (group, m, b)
        for group in ("3", "6", of_pushes_again(6).label, IN_FULL.label)
        for m in models
        for b in (1, 2)
    }
    assert (tmp_path / "data-efficiency" / "data-efficiency.svg").is_file()
    both = models | {"in-single-steps"}
    assert rows_of(make("recurrent-or-not")) == {
        (None, m, b) for m in both for b in (1, 2)
    }
    found = make("regularisation")
    assert [choice["l2"] for choice in found["choices"]] == [1e-4, 1e-6]
    assert all(np.isfinite(choice["score"]) for choice in found["choices"])
    shorter = make("shorter-training")
    sain = {"sain", "sain-shorter"}
    assert rows_of(shorter) == {(None, m, b) for m in PHYSICS | sain for b in (1, 2)}
    (claim,) = shorter["claims"]
    assert "errs at most 5% more" in claim["claim"]
    robust = make("robustness")
    groups = {row["group"] for row in robust["rows"]}
    assert len(groups) == 8
    assert groups >= {"as trained", "properties ±10 %", "angles outside", "2 mm apart"}
    # In full, on 3 and on 6 pushes, and with another l2.
    made = Counter(map(without_hash, cards(tmp_path)))
    others = {"in-seed-3", "in-single-steps-seed-0", *(f"{s}-seed-0" for s in sain)}
    assert made == {"in-seed-0": 4} | dict.fromkeys(others, 1)
    (card,) = (read_card(c.parent) for c in cards(tmp_path) if "shorter" in str(c))
    assert (card.recipe.decay, card.recipe.iterations) == ("cosine", 1)
    check_test_sets(tmp_path / STEPS)


def check_test_sets(folder):
    def pushes(name):
        (found,) = folder.glob(f"robot-{name}-{'[0-9a-f]' * 10}")
        return open_store(found).read(slice(None))

    usual, wrong = pushes("test"), pushes("test-properties-5-percent")
    for name in ("mass", "radius"):
        off = np.abs(wrong[name] / usual[name] - 1)
        np.testing.assert_allclose(off, 0.05, atol=1e-5)
    np.testing.assert_array_equal(wrong["truth"], usual["truth"])
    contact, heading = push_angles(usual)
    assert contact.max() <= np.pi / 3
    assert heading.max() <= np.pi / 6 + 1e-5
    contact, heading = push_angles(pushes("test-wide-angles-outside"))
    assert ((contact > np.pi / 3) | (heading > np.pi / 6)).all()


def test_the_score_is_the_mean_error_over_that_of_physics():
    def row(model, body, pos, rot):
        values = {"pos_mm": Estimate(pos), "rot_deg": Estimate(rot)}
        return Row(condition="", model=model, body=body, values=values)

    rows = (
        *(row("physics", 1, 4.0, 1.0), row("physics", 2, 2.0, 2.0)),
        *(row("in", 1, 1.0, 0.5), row("in", 2, 1.0, 1.0)),
        *(row("sain", 1, 2.0, 0.5), row("sain", 2, 0.5, 1.0)),
    )
    assert score(Summary(models=(), rows=rows)) == pytest.approx(
        (0.25 + 0.5 + 0.5 + 0.25 + 4 * 0.5) / 8
    )
