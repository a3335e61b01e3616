"""snapshots.zarr as xarray and zarr-python read it: names, units, laziness, and every value to the last bit."""

import json
import shutil
import tomllib
import unittest
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
import zarr

from common import Runs, columns

FIELDS = ["x", "y", "k", "r"]


def bits(values):
    """The bits of floats, those of any NaN alike."""
    values = np.asarray(values, dtype="float64")
    return np.where(np.isnan(values), np.nan, values).view("int64")


class Arrays(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.runs = Runs()
        cls.addClassCleanup(cls.runs.close)
        cls.store = cls.runs.zarr / "snapshots.zarr"

    def open(self, path=None):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return xr.open_zarr(path or self.store, chunks=None)

    def expected(self):
        """The arrays, filled row by row from snapshots.csv."""
        table = columns(self.runs.csv / "snapshots.csv")
        times = sorted(set(table["t"]))
        arrays = {name: np.full((22, len(times), 33), np.nan) for name in FIELDS}
        for row, (member, t, i) in enumerate(zip(table["member"], table["t"], table["i"])):
            for name in FIELDS:
                arrays[name][member, times.index(t), i - 1] = table[name][row]
        return times, arrays

    def test_dimensions_coordinates_and_units(self):
        data = self.open()
        self.assertEqual(dict(data.sizes), {"member": 22, "time": 4, "node": 33})
        self.assertEqual(set(data.data_vars), set(FIELDS))
        self.assertEqual(set(data.coords), {"member", "time", "node", "cell", "status"})
        for name in FIELDS:
            self.assertEqual(data[name].dims, ("member", "time", "node"))
            self.assertEqual(data[name].dtype, np.float64)
        units = {name: data[name].attrs["units"] for name in [*FIELDS, "time"]}
        self.assertEqual(units, {"x": "length", "y": "length", "k": "1/length", "r": "length", "time": "length^4"})
        self.assertTrue(all(data[name].attrs["long_name"] for name in data.variables))
        self.assertEqual([data[name].dtype for name in ["member", "node", "cell", "status"]], ["i8", "i8", "i8", "i1"])

    def test_values_are_those_of_the_table_to_the_last_bit(self):
        data = self.open()
        times, arrays = self.expected()
        self.assertTrue(np.array_equal(data.time, times))
        self.assertTrue(np.array_equal(data.member, np.arange(22)) and np.array_equal(data.node, np.arange(1, 34)))
        missing = np.isnan(arrays["x"]).any(axis=2)
        self.assertTrue(missing.any() and not missing.all())
        for name, array in arrays.items():
            self.assertTrue(np.array_equal(bits(data[name]), bits(array)), name)
            # One bit of one node is seen, and so is a member in another's place.
            other = array.copy()
            other[5, 0, 3] = np.nextafter(other[5, 0, 3], np.inf)
            self.assertFalse(np.array_equal(bits(data[name]), bits(other)), name)
            self.assertFalse(np.array_equal(bits(data[name]), bits(array[::-1])), name)

    def test_cell_and_status_are_those_of_the_summary(self):
        data = self.open()
        summary = pd.read_csv(self.runs.zarr / "summary.csv")
        self.assertTrue(np.array_equal(data.cell, summary.cell))
        flags = data.status.attrs
        names = dict(zip(flags["flag_values"], flags["flag_meanings"].split()))
        self.assertEqual([names[code] for code in data.status.values], summary.status.tolist())
        # The other way round they are not.
        names = dict(zip(flags["flag_values"], reversed(flags["flag_meanings"].split())))
        self.assertNotEqual([names.get(code) for code in data.status.values], summary.status.tolist())
        relaxed = data.x.where(data.status == 1, drop=True)
        self.assertEqual(relaxed.sizes["member"], (summary.status == "relaxed").sum())

    def test_attributes_tell_the_run(self):
        attributes = self.open().attrs
        run = json.loads((self.runs.zarr / "run.json").read_text())
        spec = tomllib.loads(attributes["spec"])
        self.assertEqual(attributes["curvelax"], run["curvelax"])
        for key in ["curves", "points", "seed", "flow", "t-end", "store", "sweep"]:
            self.assertEqual(spec[key], run["spec"][key], key)

    def test_only_what_is_asked_for_is_read(self):
        lazy = Path(self.runs.home.name) / "lazy.zarr"
        shutil.copytree(self.store, lazy)
        whole = self.open(lazy)
        for name in FIELDS:
            for chunk in (lazy / name).glob("c.*"):
                chunk.unlink()
        # Opened without its chunks, it is seen to have been lazy: what is loaded only now is missing.
        self.assertTrue(np.isnan(whole.x.values).all())
        self.assertFalse(np.isnan(self.open().x.values).all())

    def test_zarr_python_reads_each_array_without_the_consolidated_metadata(self):
        group = zarr.open_group(self.store, mode="r", use_consolidated=False)
        self.assertEqual(sorted(group.array_keys()), sorted([*FIELDS, "member", "time", "node", "cell", "status"]))
        _, arrays = self.expected()
        for name in FIELDS:
            self.assertTrue(np.array_equal(bits(group[name][:]), bits(arrays[name])), name)
            self.assertEqual(group[name].metadata.zarr_format, 3)
            self.assertTrue(np.isnan(group[name].fill_value))

    def test_the_table_is_not_written_beside_the_arrays(self):
        self.assertFalse((self.runs.zarr / "snapshots.csv").exists())
        self.assertFalse((self.runs.csv / "snapshots.zarr").exists())
        self.assertEqual([path.name for path in self.runs.zarr.iterdir() if path.name.startswith(".")], [])


if __name__ == "__main__":
    unittest.main()
