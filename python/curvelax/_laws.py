"""Numbers that differ between members, as NumPy and SciPy have them, in the words of a spec."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ._errors import RequestError

# The keys that take a distribution and nothing else.
KEYS = ("amplitude", "decay")
# Quantiles that stand for a law without a name in a spec.
QUANTILES = 1000


def spelled(keys: dict[str, Any]) -> dict[str, Any]:
    """``keys`` with arrays as ``each(...)`` and frozen distributions of ``scipy.stats`` as laws.

    An array gives the number of members, if ``curves`` does not.
    """
    keys = dict(keys)
    for key in KEYS:
        value = keys.get(key)
        if hasattr(value, "ppf") and hasattr(value, "dist"):
            keys[key] = _law(value, key)
        elif _is_list(value):
            numbers = [float(number) for number in value]
            if not numbers:
                raise RequestError(f"{key}: an empty array; give a value for each member")
            keys[key] = f"each({','.join(map(repr, numbers))})"
            if keys.get("curves") is None:
                keys["curves"] = len(numbers)
    return keys


def _is_list(value: Any) -> bool:
    """Whether it has a value for each member: an array or series of one axis, or a sequence."""
    if isinstance(value, (str, bytes)) or value is None:
        return False
    return getattr(value, "ndim", 0) == 1 or isinstance(value, Sequence)


def _law(frozen: Any, key: str) -> str:
    """A frozen distribution: by name where a spec knows it, otherwise by its quantiles."""
    name = frozen.dist.name
    shapes, loc, scale = frozen.dist._parse_args(*frozen.args, **frozen.kwds)
    loc, scale, *shapes = (float(number) for number in (loc, scale, *shapes))
    laws = {
        "norm": lambda: f"normal({loc!r},{scale!r})",
        "uniform": lambda: f"uniform({loc!r}..{loc + scale!r})",
    }
    if loc == 0.0:
        laws |= {
            "lognorm": lambda: f"lognormal({scale!r},{shapes[0]!r})",
            "halfnorm": lambda: f"halfnormal({scale!r})",
            "gamma": lambda: f"gamma({shapes[0]!r},{scale!r})",
            "weibull_min": lambda: f"weibull({shapes[0]!r},{scale!r})",
        }
    if name in laws:
        return laws[name]()
    import numpy as np

    quantiles = frozen.ppf((np.arange(QUANTILES) + 0.5) / QUANTILES)
    if not np.isfinite(quantiles).all():
        raise RequestError(f"{key}: {name} has quantiles that are not finite; give an array with a value for each member")
    return f"empirical({','.join(repr(float(number)) for number in quantiles)})"
