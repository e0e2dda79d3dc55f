"""The command line: thin subcommands, each of which calls one library function."""

import io
import signal
import sys


def main() -> None:
    """Run the command line; the console script `sainet`."""
    from sainet.runs.interrupts import end_at_interrupts

    end_at_interrupts()
    # A terminal without a character of ours shows another one in its place.
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    from sainet.cli.entry import run

    status = run()
    # Everything is written: what is left has nothing to interrupt.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise SystemExit(status)
