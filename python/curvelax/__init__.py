"""Ensembles of closed plane curves, relaxed by fourth-order geometric flows.

>>> import curvelax
>>> study = curvelax.run(curves=16, accurate=True, progress=False)
>>> study.summary.status.unique().tolist()
['relaxed']

:func:`run` relaxes an ensemble and returns a :class:`Study`, whose tables are data frames; :func:`load` reads the folder of
a finished run, and :func:`resume` continues an interrupted one. The program is the same: ``curvelax`` on the command line.
"""

# Names are imported when they are first used: the program needs neither NumPy nor pandas, which take a second.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from ._curvelax import __version__
    from ._errors import CurvelaxError, CurvelaxWarning, Interrupted, RequestError, RunError
    from ._run import load, resume, run
    from ._study import Picture, Study

__all__ = [
    "CurvelaxError",
    "CurvelaxWarning",
    "Interrupted",
    "Picture",
    "RequestError",
    "RunError",
    "Study",
    "__version__",
    "load",
    "resume",
    "run",
]

# The module of each name.
_HOMES = {
    "__version__": "_curvelax",
    "CurvelaxError": "_errors",
    "CurvelaxWarning": "_errors",
    "Interrupted": "_errors",
    "RequestError": "_errors",
    "RunError": "_errors",
    "load": "_run",
    "resume": "_run",
    "run": "_run",
    "Picture": "_study",
    "Study": "_study",
}


def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    value = getattr(importlib.import_module(f".{home}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
