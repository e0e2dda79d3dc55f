"""The command line: thin subcommands, each of which calls one library function."""

import signal


def main() -> None:
    """Run the command line; the console script `sainet`."""
    from sainet.cli.entry import run

    status = run()
    # Everything is written: what is left has nothing to interrupt.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise SystemExit(status)
