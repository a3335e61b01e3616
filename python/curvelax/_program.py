"""The program ``curvelax``, as the package installs it."""

import os
import signal
import sys

from . import _curvelax


def main() -> None:
    """Runs the program with the arguments of the process, and ends the process with its exit code."""
    # Ctrl-C is the program's matter, unless the shell wants it ignored.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    code = _curvelax.main(["curvelax", *sys.argv[1:]])
    # Nothing of Python is open.
    os._exit(code)
