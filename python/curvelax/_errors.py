"""What can go wrong, in the words of the program."""

from __future__ import annotations

from pathlib import Path


class CurvelaxError(Exception):
    """Any error of this package."""


class RequestError(CurvelaxError, ValueError):
    """A wrong request: the message names the key, its value, and what is allowed. Nothing was run."""


class RunError(CurvelaxError, RuntimeError):
    """A run that failed midway, or a folder that cannot be read or written."""


class Interrupted(KeyboardInterrupt):
    """A run that Ctrl-C stopped. :func:`curvelax.resume` continues it.

    Attributes
    ----------
    folder
        Folder of the run. A temporary one lasts as long as the interpreter.
    """

    folder: Path | None = None


class CurvelaxWarning(UserWarning):
    """Warnings about results."""
