"""Regions of ImageJ (``.roi``, and ``.zip`` of its ROI manager) as outlines, read by roifile."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from ._errors import RequestError

#: Kinds that are closed curves, and of which roifile has the coordinates.
_CLOSED = ("POLYGON", "FREEHAND", "TRACED", "RECT", "OVAL")
#: Regions that only stand in a rectangle or an oval.
_NO_OUTLINES = ("TEXT", "ARROW", "IMAGE")

#: Pixels within which two points are one.
CLOSED = 1e-3


def named(shape: Any) -> Path | None:
    """The file of regions that a shape names, if it does."""
    if isinstance(shape, str):
        if not shape.startswith("file:"):
            return None
        shape = shape.removeprefix("file:")
    elif not isinstance(shape, os.PathLike):
        return None
    path = Path(os.fspath(shape))
    return path if path.suffix.lower() in (".roi", ".zip") else None


def read(path: Path) -> dict[str, np.ndarray]:
    """The outlines in a file by the names of the regions; a name that comes again is numbered.

    Raises
    ------
    RequestError
        If roifile is missing, if the file cannot be read, or if a region is no closed curve.
    """
    try:
        import roifile
    except ImportError:
        raise RequestError(f"shape {path}: regions of ImageJ are read by roifile; pip install roifile") from None
    try:
        found = roifile.ImagejRoi.fromfile(path)
    # Whatever it raises about bytes of any kind.
    except Exception as error:
        raise RequestError(f"shape {path}: it cannot be read as regions of ImageJ ({error})") from None
    regions = found if isinstance(found, list) else [found]
    outlines: dict[str, np.ndarray] = {}
    for place, region in enumerate(regions):
        name = region.name or (path.stem if len(regions) == 1 else str(place))
        label, count = name, 1
        while label in outlines:
            count += 1
            label = f"{name} ({count})"
        outlines[label] = _points(region, f"shape {path}: region {name!r}")
    if not outlines:
        raise RequestError(f"shape {path}: there are no regions in it")
    return outlines


def _points(region: Any, what: str) -> np.ndarray:
    """The points of a region, without a last one that repeats the first."""
    kind, subtype = region.roitype.name, region.subtype.name
    if region.composite or region.multi_coordinates is not None:
        raise RequestError(f"{what} is a composite; split it in ImageJ (Edit > Selection > Split) and save its parts")
    if subtype in _NO_OUTLINES:
        kind = subtype
    elif kind == "RECT" and region.rounded_rect_arc_size:
        kind = "rounded RECT"
    if kind not in _CLOSED:
        raise RequestError(
            f"{what} is a {kind.lower()}; give polygons, freehand or traced regions, rectangles or ovals"
        )
    points = np.asarray(region.coordinates(), dtype=np.float64)
    # That of an oval does to within rounding in 32 bits.
    if len(points) > 1 and np.allclose(points[0], points[-1], rtol=0, atol=CLOSED):
        points = points[:-1]
    return points
