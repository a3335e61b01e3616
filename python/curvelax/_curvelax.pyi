"""The compiled half of the package."""

import os
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str

def main(arguments: list[str]) -> int:
    """Runs the program with these arguments, the first of which is its name; returns the exit code."""

def check_place(out: str | os.PathLike[str], existing: str) -> None:
    """Checks that a run may write into the folder ``out``: ``refused``, ``filled`` or ``replaced`` if it exists."""

def run(
    spec: str | os.PathLike[str] | None,
    keys: dict[str, Any],
    out: str | os.PathLike[str],
    existing: str,
    progress: Callable[[int, int, float], object],
    say: Callable[[str], object],
) -> tuple[str, Seen]:
    """Runs a spec in the folder ``out``; returns the overview and the snapshots."""

def resume(
    out: str | os.PathLike[str], progress: Callable[[int, int, float], object], say: Callable[[str], object]
) -> str | None:
    """Continues the run in ``out``; returns its overview, or ``None`` if it is finished."""

class Seen:
    """Snapshots that a run has passed on."""

    def arrays(self, members: list[int], times: list[float]) -> list[NDArray[np.float64]] | None:
        """x, y, k and r as arrays of member × time × node, or ``None`` if they were too many for memory."""

class FinishedRun:
    """A finished run as read from its folder."""

    def __init__(self, folder: str | os.PathLike[str]) -> None: ...
    def columns(self) -> dict[str, list[tuple[str, str, str]]]:
        """Heading, type and meaning of the columns of each table."""

    def survival(self) -> list[tuple[int, list[NDArray[np.float64]], float | None]]:
        """For each cell: times, members at risk, share not relaxed, and its 95 % band; the largest time known."""

    def times(self) -> list[float]:
        """Times of the snapshots."""

    def attributes(self) -> list[tuple[str, str]]:
        """Attributes of the arrays of snapshots, as JSON."""

    def head(self) -> tuple[str, str, list[tuple[str, int]], list[tuple[str, str, str]]]:
        """Title, what was run, members by status, headline numbers."""
