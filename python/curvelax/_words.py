"""Messages of the program in the words of Python."""

from __future__ import annotations

import re

# What a flag may have for its value in a message, besides numbers.
WORDS = {"auto", "cpu", "gpu", "f32", "f64", "direct", "gauss-seidel", "geometric", "paper", "csv", "parquet", "zarr", "spline", "polygon"}


def in_python(message: str) -> str:
    """``message`` with keywords for flags: ``--t-end 2`` is ``t_end=2``, ``--backend cpu`` is ``backend="cpu"``.

    >>> in_python("--points 5: use --points 32 or more, or --t-end auto; curvelax resume /tmp/a continues")
    'points=5: use points=32 or more, or t_end="auto"; curvelax.resume(\'/tmp/a\') continues'
    """
    resume = re.compile(r"curvelax resume ('[^']*'|[^\s;,]+)")
    message = resume.sub(lambda found: f"curvelax.resume({found[1].strip(chr(39))!r})", message)
    message = message.replace("; see --print-spec for the keys", "")
    message = re.sub(r"--([a-z][a-z0-9-]*)(?:[ =]([^\s,;:)]+))?", _keyword, message)
    # Keys as a spec file writes them.
    return re.sub(r"`([a-z]+(?:-[a-z]+)+)`", lambda found: f"`{found[1].replace('-', '_')}`", message)


def _keyword(found: re.Match[str]) -> str:
    flag, value = found[1].replace("-", "_"), found[2]
    if value is None:
        return flag
    if value in ("true", "false"):
        return f"{flag}={value.title()}"
    if value in WORDS:
        return f'{flag}="{value}"'
    is_number = re.fullmatch(r"[-+]?[0-9.]+(?:e[-+]?[0-9]+)?", value) is not None
    if is_number:
        return f"{flag}={value}"
    # A word of the sentence, or a text of the user.
    return found[0].replace(f"--{found[1]}", flag, 1)
