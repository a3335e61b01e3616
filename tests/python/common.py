"""One run of curvelax, its files, and its tables as plain Python reads them: the reference for all other readers."""

import csv
import math
import os
import subprocess
import tempfile
from pathlib import Path

CURVELAX = os.environ["CURVELAX"]

# 11 members in each of two cells: some relax and end early, and one cell's sweeps stall at once.
FLAGS = (
    "--curves 11 --points 33 --modes 2..=4 --t-end 0.64 --relax-to 0.03 --stop-when-relaxed --max-sweeps 12 --solver gauss-seidel"
    " --sweep tolerance=1e-3,1e-12 --series 0.05 --snapshots 0,0.01,0.1,0.3 --backend cpu --quiet --event half=excess<=0.5*start --event short=length<=9.4"
)


def run(flags, out):
    subprocess.run([CURVELAX, "run", *flags.split(), "--out", str(out)], check=True)
    return Path(out)


class Runs:
    """The same run with its snapshots as a table, and all tables as Parquet, too; and with its snapshots as arrays."""

    def __init__(self):
        self.home = tempfile.TemporaryDirectory()
        self.csv = run(FLAGS + " --tables parquet", Path(self.home.name) / "csv")
        self.zarr = run(FLAGS + " --store zarr", Path(self.home.name) / "zarr")

    def close(self):
        self.home.cleanup()


def rows(path):
    """The rows of a table as dictionaries of text."""
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def columns(path):
    """The columns of a table: integers, floats (an empty field is NaN), or text."""
    table = rows(path)
    return {name: column([row[name] for row in table]) for name in table[0]}


def column(fields):
    for read in (int, lambda field: float(field) if field else math.nan):
        try:
            return [read(field) for field in fields]
        except ValueError:
            pass
    return fields
