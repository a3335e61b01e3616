"""A finished run: its tables as frames, its snapshots as arrays, its pictures."""

from __future__ import annotations

import functools
import html
import importlib.util
import json
import os
import shutil
import warnings
import weakref
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from . import _curvelax, _frames
from ._errors import RequestError
from ._words import in_python

if TYPE_CHECKING:
    import matplotlib.axes
    import numpy as np
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

# What gives a run a table that it does not have.
NEEDS = {
    "events": "give events={'NAME': 'excess <= 0.5 * start'}",
    "event_statistics": "give events={'NAME': 'excess <= 0.5 * start'}",
    "event_levels": "give events={...} and refine=True",
    "levels": "give refine=True or accurate=True",
    "groups": "give group_by='PROPERTY', for outlines with properties",
    "series": "give series=DT, the interval between rows",
    "snapshots": "give snapshots=[T1, T2, ...]",
}


def remove(home: Path, owner: int) -> None:
    """Removes the temporary folder of a run, in the process that made it."""
    if os.getpid() == owner:
        shutil.rmtree(home, ignore_errors=True)


class Picture:
    """A picture of a run, shown by notebooks; ``svg`` is its text, :meth:`savefig` writes it for a paper."""

    def __init__(self, path: Path, study: Study) -> None:
        self.path = path
        self.svg = path.read_text(encoding="utf-8")
        self._study = study

    def savefig(
        self, out: str | os.PathLike[str], *, width: Literal["column", "page"] | float = "column", dpi: int | None = None
    ) -> Path:
        """Writes the picture for a paper as ``out``, whose name ends in .png or .pdf; returns its path.

        It is white, with text of 7 points, and without title and sentences, which belong in the caption. ``width`` is
        ``"column"`` (85 mm), ``"page"`` (170 mm) or 80 to 300 mm. ``dpi``, 72 to 1200, is for .png; its default is 600. An
        existing file is replaced.

        Raises
        ------
        RequestError
            For another name or width.
        """
        path = Path(out)
        content, note = self._study._run.on_paper(self.path.stem, path.suffix, str(width), dpi)
        path.write_bytes(content)
        if note is not None:
            warnings.warn(note, stacklevel=2)
        return path

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        return f"Picture({str(self.path)!r})"


class Study:
    """A finished run in its folder.

    The tables are those of the program, with its columns: :meth:`describe` says what they mean. Times are in length⁴, or in
    the units of the spec.

    Attributes
    ----------
    folder
        Folder of the results. A temporary one is removed with the study; :meth:`save` keeps it.
    overview
        What the program prints at the end of a run, if this run was made here.
    """

    def __init__(
        self,
        folder: Path,
        *,
        overview: str | None = None,
        seen: _curvelax.SnapshotBuffer | None = None,
        temporary: bool = False,
    ) -> None:
        self.folder = folder
        self.overview = overview
        self._seen = seen
        self._finalizer = weakref.finalize(self, remove, folder.parent, os.getpid()) if temporary else None

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy in another process reads the same folder, and does not own it."""
        return Study, (self.folder,)

    def __copy__(self) -> Study:
        return self

    def __deepcopy__(self, _memo: Any) -> Study:
        return self

    @functools.cached_property
    def _run(self) -> _curvelax.FinishedRun:
        return _curvelax.FinishedRun(self.folder)

    @functools.cached_property
    def record(self) -> dict[str, Any]:
        """How the run was made: the content of ``run.json``."""
        self._run  # noqa: B018  # which says what is wrong with the folder
        return json.loads((self.folder / "run.json").read_text(encoding="utf-8"))

    @property
    def spec(self) -> dict[str, Any]:
        """The resolved spec, by the names of its keys."""
        return self.record["spec"]

    @property
    def warnings(self) -> list[str]:
        """Warnings about the results, one sentence each."""
        return [in_python(warning) for warning in self.record["warnings"]]

    @property
    def tables(self) -> list[str]:
        """Names of the tables of this run."""
        return [name.removesuffix(".csv") for name in self._run.columns() if (self.folder / name).exists()]

    def table(self, name: str, *, frames: Literal["pandas", "polars"] = "pandas") -> Any:
        """The table ``name``, such as ``"rates"``, as a data frame of pandas or polars.

        Floats have every bit. An unknown number is missing; columns keep their types even if all of it is.

        Raises
        ------
        RequestError
            If the run has no such table: the message says what gives it one.
        """
        own = self._columns(name)
        path = self.folder / f"{name}.csv"
        if not path.exists():
            remedy = NEEDS.get(name, "the run has none")
            raise RequestError(f"table {name!r}: {self.folder} has no {path.name}: {remedy}")
        return _frames.read(path, own, frames)

    def to_parquet(self, out: str | os.PathLike[str]) -> list[Path]:
        """Writes every table as ``NAME.parquet`` into the folder ``out``; returns the paths. Needs pyarrow or polars.

        The values and types are those of :meth:`table`. An existing file of this name is replaced.

        Raises
        ------
        RequestError
            If neither library is installed.
        """
        has = {name: importlib.util.find_spec(name) is not None for name in ("pyarrow", "polars")}
        if not any(has.values()):
            raise RequestError("to_parquet: needs pyarrow or polars: pip install pyarrow")
        folder = Path(out)
        folder.mkdir(parents=True, exist_ok=True)
        paths = []
        for name in self.tables:
            paths.append(folder / f"{name}.parquet")
            if has["pyarrow"]:
                self.table(name).to_parquet(paths[-1], engine="pyarrow", index=False)
            else:
                self.table(name, frames="polars").write_parquet(paths[-1])
        return paths

    def _columns(self, name: str) -> list[tuple[str, str, str]]:
        columns = self._run.columns()
        if f"{name}.csv" not in columns:
            known = ", ".join(key.removesuffix(".csv") for key in columns)
            raise RequestError(f"table {name!r}: there is none of this name; use one of {known}")
        return columns[f"{name}.csv"]

    def describe(self, name: str = "summary") -> pd.DataFrame:
        """The columns of the table ``name``: what each holds and means."""
        import pandas as pd

        own = self._columns(name)
        return pd.DataFrame(own, columns=["column", "holds", "meaning"]).set_index("column")

    @functools.cached_property
    def summary(self) -> pd.DataFrame:
        """One row per member: the values of swept keys, status, ``t_relax``, rate, length, area, excess, …"""
        summary = self.table("summary")
        swept = self._swept(summary)
        for place, name in enumerate(swept, start=summary.columns.get_loc("cell") + 1):
            summary.insert(place, name, swept[name])
        return summary

    def _swept(self, rows: pd.DataFrame) -> pd.DataFrame:
        """The values of the swept keys for rows with a column ``cell``, without those that the rows have themselves."""
        names = [key for key in self.spec.get("sweep", {}) if key not in rows.columns]
        return self.ensemble.set_index("cell").loc[rows.cell, names].set_axis(rows.index)

    def frame(self) -> pd.DataFrame:
        """One row per member, with all that is known of it: swept values, what was drawn, features, label, results.

        The columns of :attr:`summary`, then those of :attr:`members`, each once: :meth:`describe` says what they mean.
        """
        members = self.members
        new = [name for name in members.columns if name == "member" or name not in self.summary.columns]
        return self.summary.merge(members[new], on="member", how="left", validate="one_to_one")

    @functools.cached_property
    def ensemble(self) -> pd.DataFrame:
        """One row per cell of the sweep: counts, mean and median times with their errors."""
        return self.table("ensemble")

    @functools.cached_property
    def members(self) -> pd.DataFrame:
        """What was drawn for each member, and its shape at the start."""
        return self.table("members")

    @functools.cached_property
    def events(self) -> pd.DataFrame:
        """First times of the events of the spec, one row per member and event."""
        return self.table("events")

    def explained(self, time: str | None = None) -> pd.DataFrame:
        """How much of the variance of a time each feature explains, cell by cell, best first.

        ``time`` is ``"t_limit"``, which is the default where the run has it, ``"t_relax"``, ``"t_half"`` or the name of an
        event. ``table("explained")`` has all of them.
        """
        rows = self.table("explained")
        return rows[rows.time == self._time(time)].reset_index(drop=True)

    def _time(self, time: str | None) -> str:
        """The name of a time, by default of the one that the report shows."""
        known = self._run.time_names()
        if time is None:
            return known[0]
        if time not in known:
            remedy = f"; {NEEDS['levels']}" if time == "t_limit" else ""
            raise RequestError(f"time {time!r}: the run has none of this name; use one of {', '.join(known)}{remedy}")
        return time

    def _survival(self, time: str) -> list[tuple[int, list[NDArray[np.float64]], float | None]]:
        """The survival curve of each cell, and the largest time up to which it is known."""
        if time != "t_half":
            return [(cell, numbers, last) for cell, (numbers, last) in self._run.survival(time)]
        curves = []
        for cell in self.ensemble.cell:
            own = self.summary[self.summary.cell == cell]
            happened = own.t_half.notna()
            # Of a vesicle that still moves at the end nothing is known.
            later_than = 0.0 if self._run.has_vesicles(int(cell)) else own.t_end
            numbers, last = self._run.survival_of(own.t_half.fillna(later_than).tolist(), happened.tolist())
            curves.append((int(cell), numbers, last))
        return curves

    @functools.cached_property
    def series(self) -> pd.DataFrame:
        """Observables of each member over time."""
        return self.table("series")

    @functools.cached_property
    def snapshots(self) -> xr.Dataset:
        """Nodes of the members at the times of ``snapshots``: x, y, k and r of member × time × node.

        Cell, status and the values of swept keys are coordinates along ``member``; long names, units and the meanings of
        the flags are attributes, by the CF conventions. The nodes come from memory where they fit, otherwise from the files
        of the run, from ``snapshots.zarr`` lazily. A member that ended earlier is NaN. Needs xarray.

        Raises
        ------
        RequestError
            If the run has no snapshots.
        """
        if not self.spec.get("snapshots"):
            raise RequestError(f"snapshots: {self.folder} has none: {NEEDS['snapshots']}")
        from . import _arrays

        data = _arrays.snapshots(self._run, self._seen, self.folder, self.table)
        rows = self.table("summary").set_index("member").loc[data["member"].to_numpy()]
        for key, values in self._swept(rows).items():
            values = values.to_numpy(dtype=None if values.dtype.kind in "iuf" else "object")
            data = data.assign_coords({key: ("member", values, {"long_name": f"{key}, a swept key"})})
        if self._finalizer is not None and (self.folder / "snapshots.zarr").exists():
            # Arrays that are read later need the folder, which goes with its study.
            data.set_close(lambda: self)
        return data

    def survival(self, time: str | None = None) -> pd.DataFrame:
        """The members that have not reached a time yet, by cell (Kaplan and Meier).

        ``time`` is ``"t_limit"``, which is the default where the run has it, ``"t_relax"``, ``"t_half"`` or the name of an
        event, whose times are limits where the run has them. ``attrs["time"]`` of the frame is its name.

        Columns: ``cell``; ``time``, 0 and the times at which members reached it; ``at_risk``, members at risk just before;
        ``survival``, the share that has not reached it after that; ``lower`` and ``upper``, its 95 % band (Greenwood).
        """
        import pandas as pd

        parts = []
        name = self._time(time)
        for cell, numbers, _ in self._survival(name):
            names = ["time", "at_risk", "survival", "lower", "upper"]
            part = pd.DataFrame(dict(zip(names, numbers, strict=True)))
            part.insert(0, "cell", cell)
            parts.append(part.astype({"at_risk": "int64"}))
        curves = pd.concat(parts, ignore_index=True)
        curves.attrs["time"] = name
        return curves

    def plot(self, ax: matplotlib.axes.Axes | None = None, *, time: str | None = None) -> matplotlib.axes.Axes:
        """Draws the survival curve of each cell with its 95 % band into ``ax``, or new axes. Needs matplotlib.

        ``time`` is as in :meth:`survival`.
        """
        import matplotlib.pyplot as plt

        ax = ax or plt.subplots()[1]
        labels = self._labels()
        name = self._time(time)
        for cell, (times, _, *shares), last in self._survival(name):
            # To the last time of a member that did not relax.
            steps = [*times, times[-1] if last is None else last]
            survival, lower, upper = ([*share, share[-1]] for share in shares)
            (line,) = ax.step(steps, survival, where="post", label=labels.get(cell))
            ax.fill_between(steps, lower, upper, step="post", alpha=0.2, color=line.get_color(), linewidth=0)
        ylabel = "members not yet relaxed" if name in ("t_limit", "t_relax") else f"members without {name}"
        ax.set(xlabel=f"{name} ({self._time_unit()})", ylabel=ylabel)
        ax.set_ylim(0, 1.02)
        if len(labels) > 1:
            ax.legend(title=", ".join(self.spec["sweep"]))
        return ax

    def _time_unit(self) -> str:
        return self._run.time_unit() or ("time of B" if "mobility" in self.spec else "length⁴")

    def _labels(self) -> dict[int, str]:
        """The values of the swept keys, by cell."""
        keys = list(self.spec.get("sweep", {}))
        return {row["cell"]: ", ".join(f"{row[key]}" for key in keys) for _, row in self.ensemble.iterrows()}

    @property
    def pictures(self) -> dict[str, Picture]:
        """The pictures of the run by name, such as ``"curves"``, ``"survival"`` or ``"features"``."""
        return {path.stem: Picture(path, self) for path in sorted((self.folder / "plots").glob("*.svg"))}

    @property
    def report(self) -> Path:
        """The page ``report.html``: the whole run at a glance, in one file."""
        return self.folder / "report.html"

    def save(self, out: str | Path) -> Path:
        """Copies the folder of results to ``out``, which must not exist; returns its path."""
        out = Path(out)
        if out.exists():
            raise RequestError(f"out {out}: exists; name another folder")
        return Path(shutil.copytree(self.folder, out))

    def __repr__(self) -> str:
        title, what, statuses, headline = self._run.head()
        counts = ", ".join(f"{count} {status}" for status, count in statuses if count)
        lines = [f"Study({str(self.folder)!r})", f"  {what}", f"  {counts}"]
        return "\n".join(lines + [f"  {label}: {value}" + (f" ({note})" if note else "") for label, value, note in headline])

    def _repr_html_(self) -> str:
        title, what, statuses, headline = self._run.head()
        rows = [(label, value, note) for label, value, note in headline]
        rows += [(status, str(count), "members") for status, count in statuses if count]
        cells = "".join("<tr>" + "".join(f"<td>{html.escape(text)}</td>" for text in row) + "</tr>" for row in rows)
        notes = "".join(f"<p>⚠ {html.escape(warning)}</p>" for warning in self.warnings)
        return f"<div><strong>{html.escape(title)}</strong><p>{html.escape(what)}</p><table>{cells}</table>{notes}</div>"
