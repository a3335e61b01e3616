"""Ensembles of closed plane curves, relaxed by fourth-order geometric flows.

>>> import curvelax
>>> study = curvelax.run(curves=16, accurate=True, progress=False)
>>> study.summary.status.unique().tolist()
['relaxed']

:func:`run` relaxes an ensemble and returns a :class:`Study`, whose tables are data frames; :func:`load` reads the folder of
a finished run, and :func:`resume` continues an interrupted one. The program is the same: ``curvelax`` on the command line.
"""

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
