"""The tables as pandas and polars read them, from CSV and from Parquet: types, and every value to the last bit."""

import math
import unittest
from pathlib import Path

import pandas as pd
import polars as pl

from common import Runs, columns, rows

ROOT = Path(__file__).resolve().parents[2]
TABLES = ["summary.csv", "members.csv", "levels.csv", "ensemble.csv", "explained.csv", "events.csv",
          "event_statistics.csv", "event_levels.csv", "rates.csv", "mean_excess.csv", "series.csv", "snapshots.csv"]
INTEGERS = {
    "summary.csv": ["member", "cell", "steps", "rejected", "sweeps_k", "sweeps_x", "turning", "solves",
                    "points"],
    "ensemble.csv": ["cell", "members", "relaxed", "unfinished", "singular", "nonfinite", "stalled", "vanished",
                     "t_relax_known", "rate_known", "discretisation_known", "t_limit_known", "t_vanish_known",
                     "t_vanish_limit_known"],
    "members.csv": ["member", "cell", "convex"],
    "explained.csv": ["cell", "members", "censored"],
    "levels.csv": ["member", "level", "cell", "points", "solves"],
    "events.csv": ["member", "cell", "censored"],
    "event_statistics.csv": ["cell", "members", "known", "discretisation_known", "t_limit_known"],
    "event_levels.csv": ["member", "level", "cell"],
    "rates.csv": ["member", "cell"],
    "mean_excess.csv": ["cell", "members"],
    "series.csv": ["member"],
    "snapshots.csv": ["member", "i"],
}
TEXT = {"summary.csv": ["status"], "levels.csv": ["status", "precision"], "explained.csv": ["time", "feature"], "events.csv": ["event"],
        "event_statistics.csv": ["event"], "event_levels.csv": ["event"]}
# What only Parquet tells: integers and words of which some are empty.
OPTIONAL_INTEGERS = {"explained.csv": ["chosen"]}
OPTIONAL_TEXT = {"summary.csv": ["label", "group"], "members.csv": ["label"], "explained.csv": ["logarithm"]}


def same(found, expected):
    """Whether two columns hold the same values, NaN being NaN; an int and a float are never the same."""

    def key(value):
        return (type(value), "NaN" if isinstance(value, float) and math.isnan(value) else value)

    return [key(value) for value in found] == [key(value) for value in expected]


class Tables(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.runs = Runs()
        cls.addClassCleanup(cls.runs.close)

    def kinds(self, table, name):
        if name in INTEGERS[table]:
            return "integer"
        return "text" if name in TEXT.get(table, []) else "float"

    def test_the_run_has_members_of_all_sorts(self):
        """Else the tests below would say little."""
        summary = columns(self.runs.csv / "summary.csv")
        self.assertEqual(set(summary["status"]), {"relaxed", "unfinished", "stalled"})
        relaxed = [not math.isnan(t) for t in summary["t_relax"]]
        self.assertTrue(any(relaxed) and not all(relaxed))

    def test_pandas_reads_types_and_values(self):
        for table in TABLES:
            path = self.runs.csv / table
            # "round_trip" is the default from pandas 3.1 on; before it, the last bit is lost now and then.
            exact = {} if pd.__version__ >= "3.1" else {"float_precision": "round_trip"}
            read = pd.read_csv(path, **exact)
            expected = columns(path)
            self.assertEqual(list(read), list(expected))
            for name in read:
                kind = self.kinds(table, name)
                is_kind = {
                    "integer": pd.api.types.is_integer_dtype,
                    "float": pd.api.types.is_float_dtype,
                    "text": pd.api.types.is_string_dtype,
                }
                self.assertTrue(is_kind[kind](read[name].dtype), f"{table}: {name} is {read[name].dtype}")
                self.assertTrue(same(read[name].tolist(), expected[name]), f"{table}: {name}")

    def test_polars_reads_types_and_values(self):
        for table in TABLES:
            path = self.runs.csv / table
            # Whole columns are looked at: the first rows of one may be empty.
            read = pl.read_csv(path, infer_schema_length=None)
            expected = columns(path)
            self.assertEqual(read.columns, list(expected))
            for series in read:
                kind = self.kinds(table, series.name)
                is_kind = {
                    "integer": series.dtype.is_integer(),
                    # polars takes a column without any value for text.
                    "float": series.dtype.is_float() or series.null_count() == len(series),
                    "text": series.dtype == pl.String,
                }
                self.assertTrue(is_kind[kind], f"{table}: {series.name} is {series.dtype}")
                values = [math.nan if value is None else value for value in series.to_list()]
                self.assertTrue(same(values, expected[series.name]), f"{table}: {series.name}")

    def test_the_lines_in_the_documents_give_empty_columns_their_type(self):
        text = (ROOT / "docs" / "files.md").read_text()
        lines = text.split("```python\n")[1].split("```")[0]
        some = 0
        for table in TABLES:
            path = self.runs.csv / table
            self.assertIn('"ellipses/summary.csv"', lines)
            names = {}
            exec(lines.replace('"ellipses/summary.csv"', repr(str(path))), names)
            read, plain = names["table"], pl.read_csv(path, infer_schema_length=None)
            for series in read:
                kind = self.kinds(table, series.name)
                right = {"integer": series.dtype.is_integer(), "float": series.dtype.is_float(),
                         "text": series.dtype == pl.String}
                self.assertTrue(right[kind], f"{table}: {series.name} is {series.dtype}")
                some += series.dtype != plain[series.name].dtype
        # The control: without these lines polars takes some columns for text.
        self.assertGreater(some, 0)

    def from_csv(self, table):
        """The columns of a table as its Parquet file should have them; an empty number is None."""
        records = rows(self.runs.csv / table)
        with open(self.runs.csv / table) as file:
            names = file.readline().rstrip("\n").split(",")
        read = {"integer": int, "float": float}
        for name in names:
            kind = "integer" if name in OPTIONAL_INTEGERS.get(table, []) else self.kinds(table, name)
            kind = "text" if name in OPTIONAL_TEXT.get(table, []) else kind
            fields = [record[name] for record in records]
            yield name, kind, fields if kind == "text" else [read[kind](field) if field else None for field in fields]

    def test_parquet_has_the_types_and_values_of_the_tables(self):
        nulls = 0
        for table in TABLES:
            path = (self.runs.csv / table).with_suffix(".parquet")
            by_polars = pl.read_parquet(path)
            by_pandas = pd.read_parquet(path, dtype_backend="numpy_nullable")
            expected = list(self.from_csv(table))
            self.assertEqual(by_polars.columns, [name for name, _, _ in expected])
            self.assertEqual(list(by_pandas), by_polars.columns)
            for name, kind, values in expected:
                types = {"integer": pl.Int64, "float": pl.Float64, "text": pl.String}
                self.assertEqual(by_polars[name].dtype, types[kind], f"{table}: {name}")
                self.assertTrue(same(by_polars[name].to_list(), values), f"{table}: {name}")
                types = {"integer": "Int64", "float": "Float64", "text": "string"}
                self.assertEqual(by_pandas[name].dtype, types[kind], f"{table}: {name}")
                read = [None if value is pd.NA else value for value in by_pandas[name].tolist()]
                self.assertTrue(same(read, values), f"{table}: {name}")
                nulls += sum(value is None for value in values)
        self.assertGreater(nulls, 100)
        self.assertEqual(len(list(self.runs.csv.glob("*.parquet"))), len(TABLES))
        self.assertEqual(list(self.runs.zarr.glob("*.parquet")), [], "which did not ask for them")

    def test_the_comparison_sees_one_bit_one_type_and_one_gap(self):
        values = [0.1, math.nan, 3.0]
        self.assertTrue(same(values, [0.1, math.nan, 3.0]))
        others = [math.nextafter(0.1, 1), math.nan, 3.0], [0.1, 0.0, 3.0], [0.1, math.nan, 3], [0.1, None, 3.0], values[:2]
        for other in others:
            self.assertFalse(same(values, other), other)

    def test_members_find_their_cell(self):
        cells = pd.read_csv(self.runs.csv / "ensemble.csv", index_col="cell")
        table = pd.read_csv(self.runs.csv / "summary.csv", index_col="member").join(cells["tolerance"], on="cell")
        self.assertEqual(table.tolerance.tolist(), [1e-3] * 11 + [1e-12] * 11)
        counts = table.groupby("cell").status.value_counts().unstack(fill_value=0)
        for status in counts:
            self.assertEqual(counts[status].tolist(), cells[status].tolist())


if __name__ == "__main__":
    unittest.main()
