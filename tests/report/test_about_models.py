"""What a report says of a trained model."""

from pathlib import Path

from msgspec.structs import replace

from sainet.engines import RECORDED
from sainet.learning.log import LogLine
from sainet.models.card import read_card
from sainet.models.library import network_folder
from sainet.report.about_models import of_network
from sainet.studies.run_report import page_of

FOLDER = Path("runs/sain")


def sentences(history=(), **changes):
    card = replace(read_card(network_folder("sain")), **changes)
    return [*of_network(card, history, FOLDER)]


def test_a_network_is_described_by_its_card():
    card = read_card(network_folder("sain"))
    made, purpose = sentences()
    assert made == (
        f"SAIN, from {card.trained_pushes:,} pushes that the engine "
        f"{card.truth_engine} simulated, of 2 disks."
    )
    assert "a pusher that follows a path" in purpose
    assert "compare physics, physics-true and runs/sain" in purpose
    assert "recorded pushes, of 1 disk." in sentences(truth_engine=RECORDED, disks=1)[0]


def test_the_training_is_told_as_it_went():
    fell = (LogLine(100, 8.0, None), LogLine(200, 2.0, None))
    assert sentences(fell)[1] == (
        "Training took 200 iterations. The loss was 8 at iteration 100, and is 2 now, "
        "4.0 times less."
    )
    assert sentences(fell[::-1])[1].endswith("is 8 now: it did not fall.")
    assert len(sentences(fell[:1])) == 2


def test_the_page_of_a_network_begins_with_it():
    page = page_of(network_folder("sain"))
    assert "SAIN, from" in page
