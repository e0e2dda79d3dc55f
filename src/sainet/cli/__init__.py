"""The command line: one thin file a subcommand, each calls one library function."""


def main() -> None:
    """Run the command line; the console script `sainet`."""
    from sainet.cli.entry import run

    raise SystemExit(run())
