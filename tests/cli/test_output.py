"""What commands print stays as it is: paths are not markup, commands are not broken."""

import pytest

from sainet.cli.output import Output
from sainet.cli.progress import progress_bar

PATH = "runs/[test]/[/test]/" + "a" * 80


def test_a_path_is_printed_as_it_is_on_one_line(capsys):
    Output().say(f"Open {PATH} in a browser.")
    assert capsys.readouterr().out == f"Open {PATH} in a browser.\n"
    Output(json=True).say(PATH)
    assert capsys.readouterr() == ("", f"{PATH}\n")
    Output().say("[bold]1[/] Simulating.", markup=True)
    assert capsys.readouterr().out == "1 Simulating.\n"


def test_quiet_says_what_the_result_lacks_alone(capsys):
    output = Output(quiet=True)
    output.say("Going on ...")
    output.warn("Left out: [in].")
    assert capsys.readouterr() == ("", "Left out: [in].\n")


@pytest.mark.parametrize("name", ["[sain]", "[/sain]"])
def test_a_bar_shows_names_as_they_are(name, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    with progress_bar(f"Pushing ({name})", 2, Output()) as advance:
        advance(2, f"{name} solved")
    shown = capsys.readouterr().err
    assert f"Pushing ({name})" in shown
    assert f"{name} solved" in shown
