"""Snapshots as an xarray dataset: the same from memory and from files."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _curvelax
from ._errors import RequestError, RunError

if TYPE_CHECKING:
    import xarray as xr

FIELDS = ["x", "y", "k", "r"]


def snapshots(
    run: _curvelax.FinishedRun, seen: _curvelax.SnapshotBuffer | None, folder: Path, table: Callable[[str], Any]
) -> xr.Dataset:
    """The snapshots of a run: from memory if all are there, else from its files."""
    import xarray as xr

    summary, times = table("summary"), run.times()
    arrays = seen.arrays(summary.member.tolist(), times) if seen is not None else None
    if arrays is None and (folder / "snapshots.zarr").exists():
        if importlib.util.find_spec("zarr") is None:
            raise RequestError(f"snapshots: {folder / 'snapshots.zarr'} needs zarr 3: pip install zarr, on Python 3.11 or later")
        return xr.open_zarr(folder / "snapshots.zarr", chunks=None)
    if arrays is None:
        arrays = _from_table(table("snapshots"), summary.member.to_numpy(), np.array(times))
        _check_complete(arrays, summary, np.array(times), folder / "snapshots.csv")
    attributes = {name: json.loads(text) for name, text in run.attributes()}
    flags = attributes["status"]
    codes = dict(zip(flags["flag_meanings"].split(), flags["flag_values"], strict=True))
    for name in FIELDS:
        attributes[name].pop("coordinates", None)

    def variable(name: str, along: Any, values: Any) -> tuple[Any, Any, dict[str, Any]]:
        return along, values, attributes[name]

    coordinates = {
        "member": variable("member", "member", summary.member.to_numpy()),
        "time": variable("time", "time", np.array(times)),
        "node": variable("node", "node", np.arange(1, arrays[0].shape[2] + 1)),
        "cell": variable("cell", "member", summary.cell.to_numpy()),
        "status": variable("status", "member", summary.status.map(codes).to_numpy(dtype="int8")),
    }
    axes = ("member", "time", "node")
    fields = {name: variable(name, axes, values) for name, values in zip(FIELDS, arrays, strict=True)}
    return xr.Dataset(fields, coordinates, attributes[""])


def _from_table(rows: Any, members: np.ndarray, times: np.ndarray) -> list[np.ndarray]:
    """The rows of ``snapshots.csv`` as arrays of member × time × node."""
    nodes = int(rows.i.max()) if len(rows) else 0
    place = (np.searchsorted(members, rows.member), np.searchsorted(times, rows.t), rows.i.to_numpy() - 1)
    arrays = []
    for name in FIELDS:
        values = np.full((len(members), len(times), nodes), np.nan)
        values[place] = rows[name]
        arrays.append(values)
    return arrays


def _check_complete(arrays: list[np.ndarray], summary: Any, times: np.ndarray, path: Path) -> None:
    """Every member has snapshots at the times before its end."""
    lost = np.isnan(arrays[0][:, :, 0]) & (times < (1 - 1e-9) * summary.t_end.to_numpy()[:, None])
    if lost.any():
        member, time = np.argwhere(lost)[0]
        where = f"member {summary.member[member]} at {times[time]}"
        raise RunError(f"snapshots: {path} is incomplete: it has no {where}; restore it, or run again")
