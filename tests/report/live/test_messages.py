"""Messages of the page: hostile ones are refused in one line, good ones are read."""

import json

import pytest

from sainet.report.live.inbox import Allowance, Inbox, Letter
from sainet.report.live.messages import (
    Aim,
    BadMessage,
    MoveDisk,
    PushNow,
    SetProperties,
    read_message,
)

DISK = {"type": "disk", "disk": 1, "x_mm": 0.0, "y_mm": 0.0}
HOSTILE = {
    "nothing": "",
    "no JSON": "push",
    "half of a message": json.dumps(DISK)[:-3],
    "a list": "[1, 2]",
    "no type": '{"x_mm": 1}',
    "unknown type": '{"type": "format-disk"}',
    "type of another kind": '{"type": 7}',
    "unknown field": json.dumps({**DISK, "z_mm": 1.0}),
    "missing field": '{"type": "disk", "disk": 1, "x_mm": 0.0}',
    "text for a number": json.dumps({**DISK, "x_mm": "0"}),
    "NaN": json.dumps({**DISK, "x_mm": float("nan")}),
    "infinity": json.dumps({**DISK, "x_mm": float("inf")}),
    "huge": '{"type": "disk", "disk": 1, "x_mm": 1e999, "y_mm": 0}',
    "far away": json.dumps({**DISK, "x_mm": 1e6}),
    "disk -1": json.dumps({**DISK, "disk": -1}),
    "half a disk": json.dumps({**DISK, "disk": 1.5}),
    "deep": "[" * 4000,
    "no UTF-8": b'{"type": "push\xff"}',
    "lone surrogate": b'{"type": "model", "model": "\xed\xa0\x80"}',
    "control characters": '{"type": "\u202e\x1b[31m"}',
    "negative mass": json.dumps(
        {
            "type": "properties",
            "mass_kg": [-1, 1],
            "radius_mm": [50, 50],
            "table_friction": 0.1,
        }
    ),
    "many masses": json.dumps(
        {
            "type": "properties",
            "mass_kg": [1] * 9,
            "radius_mm": [50] * 9,
            "table_friction": 0.1,
        }
    ),
    "five disks": '{"type": "world", "world": "planar", "noise": "none", "disks": 5}',
    "unknown world": '{"type": "world", "world": "mars", "noise": "none", "disks": 2}',
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_hostile_messages_are_refused_in_one_printable_line(text):
    with pytest.raises(BadMessage) as refused:
        read_message(text)
    assert str(refused.value).isprintable()
    assert len(str(refused.value)) < 250


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"disk": "one"}, "disk must be a whole number"),
        ({"x_mm": 1e6}, "x_mm must be at most 10000"),
        ({"y_mm": None}, "y_mm must be a number"),
        ({"z_mm": 1}, "z_mm is not a field of such messages"),
        ({"type": "disc"}, "there is no type 'disc'"),
    ],
)
def test_a_message_is_refused_in_words(change, words):
    with pytest.raises(BadMessage) as refused:
        read_message(json.dumps(DISK | change))
    assert str(refused.value).startswith(f"Message refused: {words}")
    assert not {"`", "$"} & set(str(refused.value))


def test_a_message_without_a_field_or_of_another_kind_is_refused_in_words():
    for text, words in (
        ('{"type": "disk"}', "disk is missing"),
        ("[1]", "a message must be a JSON object"),
        (HOSTILE["many masses"], "mass_kg must have at most 4 numbers"),
        (HOSTILE["unknown world"], "there is no world 'mars'"),
    ):
        with pytest.raises(BadMessage, match=f"^Message refused: {words}"):
            read_message(text)


def test_messages_are_read():
    assert read_message(json.dumps(DISK)) == MoveDisk(1, 0.0, 0.0)
    aim = '{"type": "aim", "number": 3, "contact_angle_deg": -7.5, "direction_deg": 0}'
    assert read_message(aim.encode()) == Aim(3, -7.5, 0.0)
    changed = read_message(
        '{"type": "properties", "mass_kg": [1, 2], "radius_mm": [50, 55.5],'
        ' "table_friction": 0.2}'
    )
    assert changed == SetProperties([1.0, 2.0], [50.0, 55.5], 0.2)


def received(*letters: Letter) -> list[Letter]:
    """What an inbox keeps of letters, in order."""
    inbox = Inbox()
    assert all(inbox.put(letter) for letter in letters)
    return list(inbox._waiting)


def test_only_the_newest_pointer_message_waits():
    aims = [Letter("one", Aim(n, 0.0, 0.0)) for n in range(5)]
    other = Letter("two", Aim(9, 0.0, 0.0))
    assert received(*aims[:3], other, *aims[3:]) == [aims[-1], other]
    first, second = (Letter("one", MoveDisk(n, 0.0, 0.0)) for n in (1, 2))
    again = Letter("one", MoveDisk(1, 5.0, 0.0))
    assert received(first, second, again) == [again, second]


def test_a_push_happens_where_the_disks_were():
    before, after = (Letter("one", MoveDisk(1, x, 0.0)) for x in (0.0, 5.0))
    push = Letter("one", PushNow(0.0, 0.0))
    assert received(before, push, after) == [before, push, after]


def test_an_inbox_has_room_for_a_limited_number_of_actions():
    inbox, push = Inbox(), Letter("one", PushNow(0.0, 0.0))
    taken = [inbox.put(push) for _ in range(200)]
    assert 10 < sum(taken) < 100
    assert not taken[-1]


def test_an_allowance_limits_the_rate_and_says_so_once_a_second():
    now = 100.0
    allowance = Allowance(clock=lambda: now)
    taken, news = 0, 0
    for _ in range(4000):  # a thousand messages a second, for four seconds
        now += 0.001
        is_taken = allowance.take()
        taken += is_taken
        news += not is_taken and allowance.is_news
        assert is_taken or news  # the first refusal is news
    assert 300 + 4 * 150 - 2 <= taken <= 300 + 4 * 150 + 2
    assert 1 <= news <= 4
    now += 10
    assert allowance.take()
