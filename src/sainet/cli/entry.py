"""Parse the command line, run the command, turn errors into exit statuses."""

import logging
import sys
from collections.abc import Sequence
from typing import Annotated

import tyro

import sainet
from sainet.cli.bench import Bench
from sainet.cli.control import Control
from sainet.cli.demo import Demo
from sainet.cli.evaluate import Evaluate
from sainet.cli.generate import Generate
from sainet.cli.import_ import Import
from sainet.cli.output import finish
from sainet.cli.reproduce import Reproduce
from sainet.cli.train import Train
from sainet.errors import SainetError

_Command = (
    Annotated[Demo, tyro.conf.subcommand("demo")]
    | Annotated[Generate, tyro.conf.subcommand("generate")]
    | Annotated[Import, tyro.conf.subcommand("import")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Evaluate, tyro.conf.subcommand("evaluate")]
    | Annotated[Control, tyro.conf.subcommand("control")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
)

_DESCRIPTION = """Simulator-augmented interaction networks: teach a physics engine what
it gets wrong about pushed disks, and measure how much better it became.

Start with 'sainet demo': the whole method, small, in under three minutes."""

INTERRUPTED = 130


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0, 1, 2 or 130 (Ctrl-C)."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words == ["--version"]:
        print(f"sainet {sainet.__version__}")
        return 0
    logging.basicConfig(level=logging.WARNING, format="%(message)s", stream=sys.stderr)
    try:
        command = tyro.cli(
            _Command,  # pyright: ignore[reportArgumentType]
            args=words or ["--help"],
            prog="sainet",
            description=_DESCRIPTION,
            config=(tyro.conf.OmitArgPrefixes, tyro.conf.FlagCreatePairsOff),
        )
        finish(command.run(), command.output)
    except SainetError as error:
        print(f"sainet: {error}", file=sys.stderr)
        return error.exit_status
    except KeyboardInterrupt:
        print(
            "sainet: interrupted; the same command goes on from here.", file=sys.stderr
        )
        return INTERRUPTED
    except BrokenPipeError:
        return 0
    return 0
