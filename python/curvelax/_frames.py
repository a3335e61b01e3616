"""Tables as data frames of the right types."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ._errors import RequestError

# What a column holds, in the words of the program.
INTEGER, FLOAT, SWEPT = "integer", "float", "swept value"


def read(path: Path, columns: list[tuple[str, str, str]], frames: str) -> Any:
    """The table at ``path``, whose ``columns`` are heading, type and meaning, as a frame of ``"pandas"`` or ``"polars"``."""
    kinds = {name: holds for name, holds, _ in columns}
    if frames == "pandas":
        return _pandas(path, kinds)
    if frames == "polars":
        return _polars(path, kinds)
    raise RequestError(f"frames {frames!r}: no such library is known; use 'pandas' or 'polars'")


def _pandas(path: Path, kinds: dict[str, str]) -> Any:
    import pandas as pd

    version = tuple(map(int, pd.__version__.split(".")[:2]))
    text = "str" if version >= (3, 0) else "string"
    # The default from pandas 3.1 on; before it, the last bit is lost now and then.
    exact: dict[str, Any] = {} if version >= (3, 1) else {"float_precision": "round_trip"}
    types = {INTEGER: "Int64", FLOAT: "float64"}
    # The type of a swept value is that of its key.
    dtype = {name: types.get(holds, text) for name, holds in kinds.items() if holds != SWEPT}
    # A label may be "NA": only what is empty is missing, and an empty label is empty.
    missing = {name: [""] for name, holds in kinds.items() if holds in types}
    frame = pd.read_csv(path, dtype=dtype, keep_default_na=False, na_values=missing, **exact)
    whole = [name for name in frame if kinds.get(name) == INTEGER and not frame[name].isna().any()]
    return frame.astype(dict.fromkeys(whole, "int64"))


def _polars(path: Path, kinds: dict[str, str]) -> Any:
    import polars as pl

    types = {INTEGER: pl.Int64, FLOAT: pl.Float64}
    schema = {name: types.get(holds, pl.String) for name, holds in kinds.items() if holds != SWEPT}
    with path.open(encoding="utf-8") as file:
        present = file.readline().rstrip("\r\n").split(",")
    schema = {name: kind for name, kind in schema.items() if name in present}
    words = [name for name, kind in schema.items() if kind == pl.String]
    # An empty text is a text.
    return pl.read_csv(path, schema_overrides=schema).with_columns(pl.col(words).fill_null(""))
