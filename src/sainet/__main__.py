"""Run the command line as ``python -m sainet``."""

from sainet.cli import main

if __name__ == "__main__":
    main()
