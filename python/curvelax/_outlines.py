"""Arrays as outlines: a file beside the results, so that the run can be resumed and repeated without Python."""

from __future__ import annotations

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
    if isinstance(shape, Mapping):
        named = {str(label): points for label, points in shape.items()}
        if len(named) < len(shape):
            raise RequestError("shape: two outlines have the same label")
    elif is_one(shape):
        named = {"outline": shape}
    elif isinstance(shape, (Sequence, np.ndarray)):
        named = {str(index): points for index, points in enumerate(shape)}
    else:
        raise RequestError(
            f"shape: a {type(shape).__name__} is no outline; give the name of a shape, a file, an array of points (N, 2), "
            "or several of these"
        )
    if not named:
        raise RequestError("shape: there are no outlines; give at least one array of points (N, 2)")
    alone = is_one(shape)
    return {label: outline(points, "shape" if alone else f"shape[{label!r}]") for label, points in named.items()}


def is_one(shape: Any) -> bool:
    """Whether ``shape`` is a single outline: its items are pairs of numbers, not arrays of points."""
    if isinstance(shape, np.ndarray):
        return shape.ndim <= 2 or shape.size == 0
    if isinstance(shape, Sequence) and len(shape) > 0:
        first = shape[0]
        return np.isscalar(first) or (isinstance(first, (Sequence, np.ndarray)) and len(first) > 0 and np.isscalar(first[0]))
    return False


def outline(points: Any, name: str) -> np.ndarray:
    """The points of one outline as 64-bit floats of shape (N, 2)."""
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


def save(outlines: dict[str, np.ndarray], folder: Path) -> str:
    """Writes outlines into ``folder``; returns the shape of a spec that names them."""
    path = folder.absolute() / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # By name, not as keywords: a label may be "file".
        with zipfile.ZipFile(path, "w") as archive:
            for label, points in outlines.items():
                with archive.open(f"{label}.npy", "w", force_zip64=True) as file:
                    np.lib.format.write_array(file, points, allow_pickle=False)
    except OSError as error:
        raise RequestError(f"out {folder}: the outlines cannot be written there ({error})") from None
    return f"file:{path}"
