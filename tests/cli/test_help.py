"""Help texts: whole paragraphs, one default each, plain words."""

import re
from dataclasses import fields

import pytest

from sainet.cli import entry
from sainet.cli.datasets import Settings
from sainet.cli.help import field_texts

COMMANDS = [
    "demo",
    "generate",
    "import",
    "inspect",
    "split",
    "add-bystander",
    "train",
    "tune",
    "evaluate",
    "identify",
    "cross-validate",
    "propose",
    "control",
    "play",
    "record",
    "reproduce",
    "report",
    "bench",
]
WIDTHS = (80, 120)
FORBIDDEN = r"told|tells?|believes?|know(n|s)?|sees?|say|says|alone\."
HEADING = re.compile(r"(-h, )?--[a-z]|[\[{](?!\.)|[A-Z]{2}")


def rendered(words, width, monkeypatch, capsys):
    """What `sainet WORDS --help` prints on a terminal of this width."""
    monkeypatch.setenv("COLUMNS", str(width))
    with pytest.raises(SystemExit) as stop:
        entry.parse([*words, "--help"])
    assert stop.value.code == 0
    return capsys.readouterr().out


@pytest.fixture(params=WIDTHS)
def width(request):
    return request.param


@pytest.fixture(params=[None, *COMMANDS])
def shown(request, width, monkeypatch, capsys):
    words = [request.param] if request.param else []
    return rendered(words, width, monkeypatch, capsys)


def boxed(text):
    """Lines inside the boxes, without the frame, which is spaces or lines."""
    lines = (line for line in text.splitlines() if line.startswith(("│", "  ")))
    found = [line[2:].rstrip(" │") for line in lines]
    assert found
    return found


def options(text):
    """The text of each option, its lines joined."""
    found = []
    for line in boxed(text):
        if HEADING.match(line):
            found.append([line])
        elif found and line.startswith("  "):
            found[-1].append(line)
    return [" ".join(" ".join(lines).split()) for lines in found]


def test_no_line_below_the_usage_is_wider_than_the_terminal(shown, width):
    assert max(map(len, shown.splitlines()[1:])) <= width


def test_no_placeholder_stands_for_a_default(shown):
    assert "{None}" not in shown
    assert "default: None" not in shown
    assert "default: )" not in shown


def test_every_option_shows_one_default_or_is_required_or_a_switch(shown):
    for option in options(shown):
        stated = len(re.findall(r"(?i)\bdefault: |\(required\)", option))
        switch = re.match(r"(-h, )?--[a-z-]+ [a-zA-Z]+ ?[a-z]", option)
        assert stated == 1 or (stated == 0 and switch), option


def test_a_sentence_ends_before_its_default(shown):
    for option in options(shown):
        text, stated, _ = option.partition(" (default: ")
        assert not stated or text.endswith("."), option


def test_brackets_are_closed_before_a_default(shown):
    for option in options(shown):
        before = option.partition("(default: ")[0]
        # Choices and numbers of values have brackets of their own.
        text = re.sub(r"^\S+ (\[.*?\]|\{.*?\}|[A-Z|]+)+ ", "", before)
        assert text.count("(") == text.count(")"), option


def test_words_are_plain(shown):
    text = re.sub(r"--[a-z0-9-]+", "", " ".join(shown.split()))
    assert not re.findall(rf"\b({FORBIDDEN})\b", text)


def starts_at(line, following):
    """Column of the text that goes on in the following line; None if there is none."""
    column = len(following) - len(following.lstrip())
    goes_on = column > 1 and "•" not in following
    return column if goes_on and line[column - 2 : column] == "  " else None


def test_a_paragraph_is_broken_only_where_the_line_is_full(shown, width):
    lines = boxed(shown)
    for line, following in zip(lines, lines[1:], strict=False):
        if line and following and starts_at(line, following) is not None:
            word = following.split()[0]
            assert len(line) + 1 + len(word) > width - 4, (line, following)


class Odd:
    """Settings whose texts are wrapped and in two paragraphs."""

    one: int = 0
    """A text that goes
    on here.

    Another paragraph."""
    two: int = 0
    three: int = 0
    """(mm) Starts with no letter
    `or goes on` with none."""


def test_texts_are_joined_by_paragraph():
    assert field_texts(Odd) == {
        "one": "A text that goes on here.\n\nAnother paragraph.",
        "three": "(mm) Starts with no letter `or goes on` with none.",
    }


def test_inherited_settings_keep_their_texts():
    assert field_texts(Settings).keys() == {each.name for each in fields(Settings)}
