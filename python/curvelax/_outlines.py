"""Arrays as outlines: a file beside the results, so that the run can be resumed and repeated without Python."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._errors import RequestError

NAME = "outlines.npz"


def labelled(shape: Any) -> dict[str, np.ndarray]:
    """The outlines of ``shape``, each an array of shape (N, 2), by their labels.

    ``shape`` is one array of shape (N, 2), several in an array of shape (M, N, 2) or a sequence, or a mapping from labels.

    Raises
    ------
    RequestError
        If one is no outline: the message says which, and why.
    """
    if is_one(shape):
        return {"outline": outline(shape, "shape")}
    if isinstance(shape, Mapping):
        named = {str(label): points for label, points in shape.items()}
        if len(named) < len(shape):
            raise RequestError("shape: two outlines have the same label")
    elif isinstance(shape, (Sequence, np.ndarray)):
        named = {str(index): points for index, points in enumerate(shape)}
    else:
        raise RequestError(
            f"shape: a {type(shape).__name__} is no outline; give the name of a shape, a file, an array of points (N, 2), "
            "or several of these"
        )
    if not named:
        raise RequestError("shape: there are no outlines; give at least one array of points (N, 2)")
    return {label: outline(points, f"shape[{label!r}]") for label, points in named.items()}


def is_one(shape: Any) -> bool:
    """Whether ``shape`` is a single outline: its items are pairs of numbers, not arrays of points."""
    if hasattr(shape, "columns"):
        return True
    if isinstance(shape, np.ndarray):
        return shape.ndim <= 2 or shape.size == 0
    if isinstance(shape, Sequence) and len(shape) > 0:
        first = shape[0]
        if isinstance(first, (str, os.PathLike)):
            return False
        return np.isscalar(first) or (isinstance(first, (Sequence, np.ndarray)) and len(first) > 0 and np.isscalar(first[0]))
    return False


def outline(points: Any, name: str) -> np.ndarray:
    """The points of one outline as 64-bit floats of shape (N, 2)."""
    if isinstance(points, (str, os.PathLike)):
        raise RequestError(
            f"{name}: {str(points)!r} is no array; for several shapes use sweep={{'shape': [...]}}, for several files "
            "shape='files:PATTERN'"
        )
    if np.ma.isMaskedArray(points) and np.ma.getmaskarray(points).any():
        raise RequestError(f"{name}: points are masked; leave them out, such as by points[~points.mask.any(axis=1)]")
    if hasattr(points, "columns"):
        points = _of_frame(points, name)
    try:
        array = np.asarray(points)
    except ValueError as error:
        raise RequestError(f"{name}: the points are no array ({error}); give one of shape (N, 2)") from None
    if array.dtype.kind not in "iuf":
        raise RequestError(f"{name}: the array has the type {array.dtype}; give real numbers")
    if array.ndim != 2 or array.shape[1] != 2:
        raise RequestError(f"{name}: the array has the shape {array.shape}; give one of shape (N, 2), a point in each row")
    if len(array) < 3:
        raise RequestError(f"{name}: {len(array)} points bound no area; give at least 3")
    array = array.astype(np.float64)
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if len(bad):
        raise RequestError(f"{name}: point {bad[0]} is {tuple(map(float, array[bad[0]]))}; give finite numbers")
    return array


def _of_frame(frame: Any, name: str) -> np.ndarray:
    """The columns ``x`` and ``y`` of a data frame, or its only two."""
    columns = [str(column) for column in frame.columns]
    by_name = {column.lower(): place for place, column in enumerate(columns)}
    if {"x", "y"} <= by_name.keys():
        places = [by_name["x"], by_name["y"]]
    elif len(columns) == 2:
        places = [0, 1]
    else:
        raise RequestError(f"{name}: the frame has the columns {', '.join(columns)}; give it columns x and y")
    return frame.to_numpy()[:, places]


def save(outlines: dict[str, np.ndarray], path: Path) -> str:
    """Writes outlines to ``path``; returns the shape of a spec that names them."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Not as keywords of numpy.savez: a label may be "file".
        with zipfile.ZipFile(path, "w") as archive:
            for label, points in outlines.items():
                with archive.open(f"{label}.npy", "w", force_zip64=True) as file:
                    np.lib.format.write_array(file, points, allow_pickle=False)
    except OSError as error:
        raise RequestError(f"out {path.parent}: the outlines cannot be written there ({error})") from None
    return f"file:{path}"
