"""The `pegfit` command."""

import sys

from pegfit import _core


def main() -> None:
    """Runs the command line and ends the process with the command's exit code."""
    sys.exit(_core.command(sys.argv))
