"""Runs: from keywords to a :class:`Study`."""

from __future__ import annotations

import atexit
import contextlib
import functools
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _curvelax
from ._errors import CurvelaxError, CurvelaxWarning, Interrupted, RequestError
from ._laws import spelled
from ._study import Study, remove
from ._words import in_python

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._keys import Keys

Progress = Callable[[int, int, float], object]


def run(
    spec: str | os.PathLike[str] | None = None,
    /,
    *,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    progress: bool | Progress | None = None,
    **keys: Unpack[Keys],
) -> Study:
    """Relaxes an ensemble of curves.

    Parameters
    ----------
    spec
        Spec file in TOML. Without one, keys that are not given have the defaults of ``curvelax run``.
    out
        Folder for the results, which must not exist yet. Without it, results go to a temporary folder, which is removed
        when the study is no longer in use.
    force
        Write into an existing folder, replacing the earlier run in it. A folder that holds anything else is refused.
    progress
        Whether to show how far the run is; by default in notebooks and terminals. With tqdm it is a bar of tqdm. A function
        is called with the runs of members that have ended, all runs, and the share of the work that is done.
    **keys
        Keys of the spec, with ``_`` for ``-``: ``curves=1000``, ``flow="willmore"``, ``t_end="auto"``,
        ``sweep={"amplitude": [0.05, 0.1]}``. ``accurate=True`` is ``--accurate``, and ``events={"half": "excess <= 0.5 *
        start"}`` names events. ``shape`` may be an array of points (N, 2), several of these in a list, or a dict from labels
        to these; lengths are in your unit, times in its fourth power. Contours of OpenCV, (N, 1, 2), are such arrays.
        Contours of ``skimage.measure.find_contours`` are, too, but with rows and columns in the place of x and y, which
        mirrors the outline and changes no time: give ``contour[:, ::-1]`` to see it as the image shows it. Polygons of
        Shapely and all other objects with ``__geo_interface__`` are outlines; of a GeoSeries or GeoDataFrame the index is
        the labels and its columns serve ``group_by``. A path to a ``.roi`` or ``.zip`` of ImageJ gives the polygons,
        freehand and traced regions, rectangles and ovals in it, labelled by their names, in pixels with y downwards as in the
        image; ``pip install roifile`` reads them. ``amplitude`` and ``decay`` take a distribution such as ``"gamma(2,0.02)"``, an
        array with a value for each member, or a frozen distribution of ``scipy.stats``.

    Returns
    -------
    Study
        The finished run.

    Raises
    ------
    RequestError
        For wrong keys or values, before any work.
    RunError
        If the run fails midway. What had ended is in ``out``; :func:`resume` continues.
    Interrupted
        If Ctrl-C (or the notebook's stop button) stopped it. Likewise.

    Examples
    --------
    >>> import curvelax
    >>> study = curvelax.run(curves=8, adaptive=1e-3, stop_when_relaxed=True, progress=False)
    >>> len(study.summary)
    8
    """
    keys = spelled(keys)
    shape, sweep = keys.get("shape"), keys.get("sweep")
    swept = sweep.get("shape") if isinstance(sweep, dict) else None
    if swept is not None and (shape is not None or any(map(_is_arrays, swept))):
        raise RequestError("sweep: only named shapes and files are swept; give arrays as an ensemble by shape=[...] alone")
    folder = _temporary() if out is None else _absolute(out)
    existing = "replaced" if force else "refused"
    existed, written, kept = folder.exists(), None, None
    try:
        regions = _regions_of(shape)
        if regions is not None:
            shape = regions
        if isinstance(shape, os.PathLike):
            keys["shape"] = f"file:{os.fspath(shape)}"
        elif _is_arrays(shape):
            # Here, for the program is to start without numpy.
            from . import _outlines

            name, outlines = _outlines.packed(shape)
            _curvelax.check_place(folder, existing)
            # Where there is no run, the outlines will be the only file.
            free = not force or _is_free(folder)
            written = folder / name
            if written.exists():
                kept = written.rename(written.with_suffix(".before"))
            keys["shape"] = _outlines.save(outlines, written)
            existing = "filled" if free else existing
        with _bar(progress) as show:
            overview, seen = _curvelax.run(spec, keys, folder, existing, show, functools.partial(_say, written=written))
    except BaseException as error:
        _leave(folder, existed, written, kept)
        if isinstance(error, KeyboardInterrupt):
            raise _interrupted(error, folder) from None
        if written is not None and isinstance(error, CurvelaxError):
            error.args = (_without(str(error), written),)
        raise
    if kept is not None:
        kept.unlink()
    return Study(folder, overview=overview, seen=seen, temporary=out is None)


def resume(out: str | os.PathLike[str], *, progress: bool | Progress | None = None) -> Study:
    """Continues the interrupted run in the folder ``out``; a finished one is only read.

    All files end up as those of an uninterrupted run. ``progress`` is as for :func:`run`.

    Raises
    ------
    RequestError
        If there is no run in ``out``.
    RunError, Interrupted
        As for :func:`run`.
    """
    folder = _absolute(out)
    try:
        with _bar(progress) as show:
            overview = _curvelax.resume(folder, show, _say)
    except KeyboardInterrupt as error:
        raise _interrupted(error, folder) from None
    return Study(folder, overview=overview)


def load(out: str | os.PathLike[str]) -> Study:
    """Reads the finished run in the folder ``out``, by this package or by the program.

    Raises
    ------
    RequestError
        If there is no finished run in ``out``.
    """
    study = Study(_absolute(out))
    study.record  # noqa: B018  # read now, so that what is wrong is said here
    return study


def _is_arrays(shape: Any) -> bool:
    """Whether a shape is given by points, not by its name or file."""
    return not isinstance(shape, (str, os.PathLike)) and shape is not None


def _regions_of(shape: Any) -> Any:
    """The outlines in a file of ImageJ, if the shape names one."""
    if not isinstance(shape, (str, os.PathLike)):
        return None
    from . import _regions

    path = _regions.named(shape)
    return None if path is None else _regions.read(path)


def _temporary() -> Path:
    """A folder to be made, in one that is removed at the end of the interpreter if not before."""
    home = Path(tempfile.mkdtemp(prefix="curvelax-"))
    atexit.register(remove, home, os.getpid())
    return home / "run"


def _absolute(out: str | os.PathLike[str]) -> Path:
    """The folder, wherever the process goes."""
    return Path(os.path.abspath(Path(out).expanduser()))


def _leave(folder: Path, existed: bool, written: Path | None, kept: Path | None) -> None:
    """Leaves a folder in which no run began as it was before."""
    if folder.is_dir() and any(path.name.startswith(".curvelax") for path in folder.iterdir()):
        return
    with contextlib.suppress(OSError):
        if written is not None:
            written.unlink(missing_ok=True)
            if kept is not None:
                kept.replace(written)
        if folder.is_dir() and not existed:
            folder.rmdir()


def _is_free(folder: Path) -> bool:
    """Whether nothing in the folder has the name of a file of a run."""
    try:
        _curvelax.check_place(folder, "filled")
    except RequestError:
        return False
    return True


def _interrupted(error: KeyboardInterrupt, folder: Path) -> Interrupted:
    """Ctrl-C of the program, or of the interpreter when the run was about to end."""
    if not isinstance(error, Interrupted):
        error = Interrupted(f"stopped by Ctrl-C at the end; curvelax.resume({str(folder)!r}) continues or reads the run")
    error.folder = folder
    return error


def _say(line: str, written: Path | None = None) -> None:
    """What the program says on stderr: warnings as such; the rest can be read in the overview."""
    kind, _, text = line.partition(": ")
    if kind == "warning":
        warnings.warn(in_python(_without(text, written)), CurvelaxWarning, stacklevel=3)


def _without(text: str, written: Path | None) -> str:
    """The text without the file into which this package wrote the outlines."""
    if written is None:
        return text
    for words in (f"shape file:{written}", f"shape {written}", f"file:{written}", str(written)):
        text = text.replace(words, "shape")
    return text


@contextlib.contextmanager
def _bar(progress: bool | Progress | None) -> Iterator[Progress]:
    """The function that shows progress."""
    if callable(progress):
        last = (0, 0, 0.0)

        def tell(*state: Any) -> None:
            nonlocal last
            last = state
            progress(*state)

        yield tell
        if last[0] < last[1] or last[2] < 1.0:
            progress(last[1], last[1], 1.0)
        return
    if not (progress if progress is not None else _is_watched()):
        yield lambda *_: None
        return
    try:
        from tqdm.auto import tqdm
    except ImportError:
        with _line() as show:
            yield show
        return
    bar_format = "{percentage:3.0f}%|{bar}| {desc} [{elapsed}<{remaining}]"
    with tqdm(total=1.0, bar_format=bar_format, leave=False) as bar:

        def show(done: int, total: int, share: float) -> None:
            bar.set_description_str(f"{done} of {total} runs", refresh=False)
            bar.update(share - bar.n)

        yield show


@contextlib.contextmanager
def _line() -> Iterator[Progress]:
    """A line that is written anew, for notebooks and terminals without tqdm. It is gone at the end."""
    handle, width = None, 0
    if _is_notebook():
        from IPython.display import HTML, display

        handle = display(HTML(""), display_id=True)

    def show(done: int, total: int, share: float) -> None:
        nonlocal width
        words = f"{100 * share:3.0f} % {done} of {total} runs"
        if handle is not None:
            handle.update(HTML(f'<progress max="1" value="{share:.3f}"></progress> {words}'))
        elif sys.stderr is not None:
            width = len(words)
            sys.stderr.write(f"\r{words}")
            sys.stderr.flush()

    try:
        yield show
    finally:
        if handle is not None:
            handle.update(HTML(""))
        elif width > 0 and sys.stderr is not None:
            sys.stderr.write("\r" + " " * width + "\r")
            sys.stderr.flush()


def _is_notebook() -> bool:
    """Whether IPython shows what is displayed."""
    return "IPython" in sys.modules and sys.modules["IPython"].get_ipython() is not None


def _is_watched() -> bool:
    """Whether somebody may look at a bar: in a notebook, or at a terminal."""
    return _is_notebook() or (sys.stderr is not None and sys.stderr.isatty())
