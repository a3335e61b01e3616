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
) -> tuple[str, SnapshotBuffer]:
    """Runs a spec in the folder ``out``; returns the overview and the snapshots."""

def resume(
    out: str | os.PathLike[str], progress: Callable[[int, int, float], object], say: Callable[[str], object]
) -> str | None:
    """Continues the run in ``out``; returns its overview, or ``None`` if it is finished."""

class SnapshotBuffer:
    """Snapshots that a run has passed on."""

    def arrays(self, members: list[int], times: list[float]) -> list[NDArray[np.float64]] | None:
        """x, y, k and r as arrays of member × time × node, or ``None`` if they were too many for memory."""

class FinishedRun:
    """A finished run as read from its folder."""

    def __init__(self, folder: str | os.PathLike[str]) -> None: ...
    def columns(self) -> dict[str, list[tuple[str, str, str]]]:
        """Heading, type and meaning of the columns of each table."""

    def time_names(self) -> list[str]:
        """The times of which there are statistics; the one that is shown comes first, events last."""

    def survival(self, time: str) -> list[tuple[int, tuple[list[NDArray[np.float64]], float | None]]]:
        """For each cell: times, members at risk, share without it, and its 95 % band; the largest time known."""

    @staticmethod
    def survival_of(times: list[float], happened: list[bool]) -> tuple[list[NDArray[np.float64]], float | None]:
        """The same of any times, of which those that did not happen are censored."""

    def has_vesicles(self, cell: int) -> bool:
        """Whether the members of a cell are vesicles."""

    def time_unit(self) -> str | None:
        """The unit of times, if it has a name."""

    def times(self) -> list[float]:
        """Times of the snapshots."""

    def attributes(self) -> list[tuple[str, str]]:
        """Attributes of the arrays of snapshots, as JSON."""

    def on_paper(self, name: str, extension: str, width: str, dpi: int | None) -> tuple[bytes, str | None]:
        """A picture as the file for a paper, .png or .pdf, and what is said of letters that it lacks."""

    def head(self) -> tuple[str, str, list[tuple[str, int]], list[tuple[str, str, str]]]:
        """Title, what was run, members by status, headline numbers."""
