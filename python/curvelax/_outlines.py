"""Arrays and geometries as outlines: a file with the results, so that the run can be resumed and repeated without Python."""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._errors import RequestError


def packed(shape: Any) -> tuple[str, bytes]:
    """The name and the content of the file that holds the outlines of ``shape``.

    Geometries, which are objects with ``__geo_interface__``, become GeoJSON, which keeps their labels and properties;
    points become arrays.

    Raises
    ------
    RequestError
        If one is no outline: the message says which, and why.
    """
    collection = _collection(shape)
    if collection is not None:
        return "outlines.geojson", json.dumps(collection, default=_plain).encode()
    return "outlines.npz", _archive(labelled(shape))


def save(outlines: bytes, path: Path) -> str:
    """Writes outlines to ``path``; returns the shape of a spec that names them."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(outlines)
    except OSError as error:
        raise RequestError(f"out {path.parent}: the outlines cannot be written there ({error})") from None
    return f"file:{path}"


def _archive(outlines: dict[str, np.ndarray]) -> bytes:
    """Arrays by their labels, as ``numpy.load`` reads them."""
    content = io.BytesIO()
    # Not as keywords of numpy.savez: a label may be "file".
    with zipfile.ZipFile(content, "w") as archive:
        for label, points in outlines.items():
            with archive.open(f"{label}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, points, allow_pickle=False)
    return content.getvalue()


def _collection(shape: Any) -> dict[str, Any] | None:
    """The FeatureCollection of objects with ``__geo_interface__``, such as those of Shapely and GeoPandas.

    ``None`` if ``shape`` is none and holds none. A GeoSeries or GeoDataFrame is labelled by its index. Coordinates are
    those of a plane, unless a frame says that they are degrees.
    """
    if hasattr(shape, "__geo_interface__"):
        features = _features(shape.__geo_interface__)
    else:
        if not isinstance(shape, (Mapping, list, tuple)):
            return None
        items = _by_label(shape)
        strangers = [label for label, item in items.items() if not hasattr(item, "__geo_interface__")]
        if len(strangers) == len(items):
            return None
        if strangers:
            raise RequestError(f"shape[{strangers[0]!r}]: arrays and geometries in one shape; give all outlines as one of them")
        features = [
            {**feature, "id": label} for label, item in items.items() for feature in _features(item.__geo_interface__)
        ]
    collection: dict[str, Any] = {"type": "FeatureCollection", "features": features}
    if not getattr(getattr(shape, "crs", None), "is_geographic", False):
        collection["crs"] = None
    return collection


def _features(interface: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The features of a geo interface (https://gist.github.com/sgillies/2217756), which may be a bare geometry."""
    kind = interface["type"]
    if kind == "FeatureCollection":
        return [feature for own in interface["features"] for feature in _features(own)]
    if kind == "Feature":
        feature = dict(interface, geometry=_geometry(interface["geometry"]))
        feature.pop("bbox", None)
        return [feature]
    return [{"type": "Feature", "geometry": _geometry(interface), "properties": {}}]


def _geometry(geometry: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """A geometry as GeoJSON knows it, which has no LinearRing."""
    if geometry is not None and geometry["type"] == "LinearRing":
        return {"type": "Polygon", "coordinates": [geometry["coordinates"]]}
    return None if geometry is None else dict(geometry)


def _plain(value: Any) -> Any:
    """A property of a feature that JSON does not know: a number of NumPy, a date."""
    return value.item() if isinstance(value, np.generic) else str(value)


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
    if not isinstance(shape, (Mapping, Sequence, np.ndarray)):
        raise RequestError(
            f"shape: a {type(shape).__name__} is no outline; give the name of a shape, a file, an array of points (N, 2), "
            "or several of these"
        )
    named = _by_label(shape)
    if not named:
        raise RequestError("shape: there are no outlines; give at least one array of points (N, 2)")
    return {label: outline(points, f"shape[{label!r}]") for label, points in named.items()}


def _by_label(shape: Mapping[Any, Any] | Sequence[Any] | np.ndarray) -> dict[str, Any]:
    """The items of ``shape`` by their keys, or by their indices, as text."""
    pairs = shape.items() if isinstance(shape, Mapping) else enumerate(shape)
    named = {str(label): item for label, item in pairs}
    if len(named) < len(shape):
        raise RequestError("shape: two outlines have the same label")
    return named


def is_one(shape: Any) -> bool:
    """Whether ``shape`` is a single outline: its items are pairs of numbers, not arrays of points."""
    if hasattr(shape, "columns"):
        return True
    if isinstance(shape, np.ndarray):
        return shape.ndim <= 2 or shape.size == 0 or _is_of_opencv(shape)
    if isinstance(shape, Sequence) and len(shape) > 0:
        first = shape[0]
        if isinstance(first, (str, os.PathLike)):
            return False
        return np.isscalar(first) or (isinstance(first, (Sequence, np.ndarray)) and len(first) > 0 and np.isscalar(first[0]))
    return False


def _is_of_opencv(array: np.ndarray) -> bool:
    """Whether it may be a contour of ``cv2.findContours``: points along the first axis, nothing along the second."""
    return array.ndim == 3 and array.shape[1:] == (1, 2) and len(array) > 1


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
    if _is_of_opencv(array):
        array = array[:, 0]
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
