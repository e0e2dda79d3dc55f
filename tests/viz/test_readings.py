"""The sentences of docs/results.md say what the table says, and not its opposite."""

import runpy

from support import REPOSITORY

READINGS = runpy.run_path(str(REPOSITORY / "tools" / "readings.py"))


def errors(model: str, pos: tuple[float, float], rot: tuple[float, float]) -> list:
    return [
        {
            "model": model,
            "body": body,
            "pos_mm": pos[body - 1],
            "rot_deg": rot[body - 1],
        }
        for body in (1, 2)
    ]


def pair(metric: str, body: int, low: float, high: float, against: str) -> dict:
    return {
        **{"model": "sain", "against": against, "metric": metric, "body": body},
        "interval": [low, high],
    }


def test_errors_stand_in_relation_to_physics_and_to_what_a_model_is_compared_with():
    calibrated = "physics-calibrated"
    told = READINGS["of_errors"](
        {
            "rows": errors("physics", (4.0, 2.0), (1.0, 0.5))
            + errors(calibrated, (2.0, 0.5), (1.0, 0.5))
            + errors("sain", (1.0, 1.0), (0.1, 0.25)),
            "published": errors("physics", (10.0, 5.0), (2.0, 1.0))
            + errors("sain", (9.0, 3.0), (1.0, 0.2)),
            "comparisons": [
                pair("pos_mm", 1, -1.1, -0.9, calibrated),
                pair("pos_mm", 2, 0.4, 0.6, calibrated),
                pair("rot_deg", 1, -0.1, 0.1, calibrated),
                pair("final_pos_mm", 1, 1.0, 2.0, calibrated),
                pair("pos_mm", 1, -0.1, 0.1, "in"),
            ],
        }
    )
    assert "| Physics, calibrated | 0.50 / 0.25 | 1.00 / 1.00 |" in told
    assert "| SAIN | 0.25 / 0.50 | 0.10 / 0.50 |" in told
    assert "| *SAIN, published* | 0.90 / 0.60 | 0.50 / 0.20 |" in told
    assert "SAIN is better in pos of disk 1 and worse in pos of disk 2" in told
    assert "alone leave 0.50 / 0.25, learning around wrong ones leaves 0.25" in told
    assert "Against IN, SAIN is neither better nor worse." in told


def test_control_says_where_models_differ_in_what_they_solve():
    def row(group: str, model: str, solved: int) -> dict:
        return {"group": group, "model": model, "solved": solved}

    def test(group: str, measure: str, p: float) -> dict:
        return {"group": group, "measure": measure, "p": p}

    told = READINGS["of_control"](
        {
            "rows": [
                *(row("easy", "physics", 99), row("easy", "sain", 100)),
                *(row("three disks", "physics", 2), row("three disks", "sain", 40)),
            ],
            "pairs": [
                *(test("easy", "solved", 0.5), test("easy", "within_4_mm", 0.001)),
                test("three disks", "solved", 0.001),
            ],
        }
    )
    assert "what they solve in: easy. They do in *three disks*" in told
    assert told.endswith("trained on: Physics 2; SAIN 40.")
