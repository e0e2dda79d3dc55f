"""Parse the command line, run the command, turn errors into exit statuses."""

import logging
import sys
from collections.abc import Sequence
from functools import reduce
from operator import or_
from typing import Annotated, Any

import tyro
from tyro.conf import subcommand

import sainet
from sainet.cli.bench import Bench
from sainet.cli.control import Control
from sainet.cli.cross_validate import CrossValidate
from sainet.cli.datasets import AddBystander, Generate, Import, Split
from sainet.cli.demo import Demo
from sainet.cli.evaluate import Evaluate
from sainet.cli.help import message, option_registry
from sainet.cli.identify import Identify
from sainet.cli.inspect import Inspect
from sainet.cli.output import drop_output, finish
from sainet.cli.play import Play
from sainet.cli.propose import Propose
from sainet.cli.record import Record
from sainet.cli.report import MakeReport
from sainet.cli.reproduce import Reproduce
from sainet.cli.train import Train
from sainet.cli.tune import Tune
from sainet.runs.documents import is_full
from sainet.runs.errors import BadInput, BadTable, SainetError, unknown_name
from sainet.runs.interrupts import INTERRUPTED, raise_interrupts, remembered_interrupts

_COMMANDS = {
    "demo": Demo,
    "play": Play,
    "generate": Generate,
    "record": Record,
    "import": Import,
    "inspect": Inspect,
    "split": Split,
    "add-bystander": AddBystander,
    "train": Train,
    "tune": Tune,
    "evaluate": Evaluate,
    "identify": Identify,
    "cross-validate": CrossValidate,
    "propose": Propose,
    "control": Control,
    "reproduce": Reproduce,
    "report": MakeReport,
    "bench": Bench,
}


_COMMAND: Any = reduce(
    or_, (Annotated[kind, subcommand(name)] for name, kind in _COMMANDS.items())
)

_DESCRIPTION = """Simulator-augmented interaction networks for pushed disks.

Start with 'sainet demo', which runs the whole method at small scale."""

# Commands that an identical call resumes, if they have a folder.
_RESUMABLE = (
    *(Demo, Generate, Record, Import, Split, Train, Tune, Control, Reproduce),
    *(CrossValidate, Evaluate),
)


def parse(words: Sequence[str]) -> Any:  # noqa: ANN401
    """Return the command that these words ask for, not yet run.

    Raises:
        UnknownName: there is no such command.
        BadInput: a setting is out of its range.
        SystemExit: help was asked for (0), or there is no such option (2).
    """
    if words and words[0][:1] not in ("-", "") and words[0] not in _COMMANDS:
        raise unknown_name("command", words[0], _COMMANDS)
    return tyro.cli(
        _COMMAND,
        args=list(words) or ["--help"],
        prog="sainet",
        description=_DESCRIPTION,
        registry=option_registry(),
        config=(tyro.conf.OmitArgPrefixes, tyro.conf.FlagCreatePairsOff),
    )


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0, 1, 2 or 130 (Ctrl-C)."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words == ["--version"]:
        print(f"sainet {sainet.__version__}")
        return 0
    logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stderr)
    command = None
    try:
        command = parse(words)
        raise_interrupts()
        with remembered_interrupts():
            finish(command.run(), command.output)
    except SainetError as error:
        command_type = _COMMANDS.get(words[0] if words else "")
        table = isinstance(error, BadTable)
        for each in map(BadTable, error.problems) if table else [error]:
            print(f"sainet: {message(each, command_type)}", file=sys.stderr)
        return error.exit_status
    except KeyboardInterrupt:
        is_kept = getattr(command, "out", True) is not None
        resumes = is_kept and isinstance(command, _RESUMABLE)
        verb = "resumes" if resumes else "starts over"
        print(f"sainet: interrupted; the same command {verb}.", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        return 0
    except OSError as error:
        if error.filename is None and not is_full(error):
            raise
        print(f"sainet: {message(_reason(error))}", file=sys.stderr)
        if error.filename is None:
            drop_output()
        return BadInput.exit_status
    return 0


def _reason(error: OSError) -> BadInput:
    """Return why a path or the output could not be used, in one line."""
    if error.filename is None:
        return BadInput("output: the disk is full; make room, or write to another.")
    # For example a name that is too long, or a folder without permission.
    return BadInput(f"{error.filename}: {error.strerror}; give another path.")
