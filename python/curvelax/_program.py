"""The program ``curvelax``, as the package installs it."""

# The built-in half of ``signal``, which imports more.
import _signal

# First of all, so that Ctrl-C does not end in a traceback: it ends the process, until the program itself handles it. A shell
# may want it ignored.
if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
    _signal.signal(_signal.SIGINT, _signal.SIG_DFL)

import os  # noqa: E402
import sys  # noqa: E402


def main() -> None:
    """Runs the program with the arguments of the process, and ends the process with its exit code."""
    from . import _curvelax

    code = _curvelax.main(["curvelax", *sys.argv[1:]])
    # Nothing of Python is open.
    os._exit(code)
