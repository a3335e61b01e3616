"""The Python package, as installed from its wheel: the same bits as the program, types, errors, interruption."""

import contextlib
import doctest
import filecmp
import importlib.util
import io
import json
import os
import pathlib
import re
import pickle
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import unittest.mock
import warnings
from importlib import metadata, resources

import numpy as np
import pandas as pd
import polars as pl
import xarray as xr

import curvelax
import reference
from common import CURVELAX, run

ROOT = pathlib.Path(__file__).resolve().parents[3]
# What differs between equal runs: times, and the place of the outlines.
CLOCKS = {"run.json", "report.html"}
KEYS = {
    "curves": 9, "points": 32, "adaptive": 1e-3, "stop_when_relaxed": True, "series": 0.2, "snapshots": [0, 0.01, 0.1, 5],
    "t_end": 5, "events": {"half": "excess <= 0.5 * start", "never": "length >= 1e6"}, "backend": "cpu",
}
FLAGS = (
    "--curves 9 --points 32 --adaptive=1e-3 --stop-when-relaxed --series 0.2 --snapshots 0,0.01,0.1,5 --t-end 5"
    " --event half=excess<=0.5*start --event never=length>=1e6 --backend cpu --quiet"
)
# What is waited for so long does not come, on any machine.
HANGS = 6 * 3600
SMALL = {"curves": 3, "points": 32, "adaptive": 1e-3, "stop_when_relaxed": True, "backend": "cpu", "progress": False}


def angles(n):
    return np.linspace(0, 2 * np.pi, n, endpoint=False)


def ellipse(a, b, n=60):
    return np.c_[a * np.cos(angles(n)), b * np.sin(angles(n))]


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in pathlib.Path(folder).rglob("*") if path.is_file())


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.home = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.home.cleanup)
        cls.at = pathlib.Path(cls.home.name)
        cls.program = run(FLAGS, cls.at / "program")
        cls.study = curvelax.run(out=cls.at / "package", progress=False, **KEYS)

    def setUp(self):
        """What libraries deprecate, users would see."""
        catch = warnings.catch_warnings()
        catch.__enter__()
        self.addCleanup(catch.__exit__, None, None, None)
        for category in (DeprecationWarning, FutureWarning):
            warnings.simplefilter("error", category)

    def refused(self, *words, **keys):
        """The message of a refusal before any work."""
        with self.assertRaises(curvelax.RequestError) as caught:
            curvelax.run(progress=False, **keys)
        for word in words:
            self.assertIn(word, str(caught.exception))
        return str(caught.exception)

    # The same as the program

    def test_files_are_those_of_the_program_to_the_last_byte(self):
        names = files(self.program)
        self.assertEqual(names, files(self.study.folder))
        self.assertIn("snapshots.csv", names)
        same, other, errors = filecmp.cmpfiles(self.program, self.study.folder, names, shallow=False)
        self.assertEqual((set(other) - CLOCKS, errors), (set(), []))
        other = curvelax.run(out=self.at / "seed", progress=False, **KEYS, seed=2)
        same, _, _ = filecmp.cmpfiles(self.program, other.folder, names, shallow=False)
        self.assertNotIn("summary.csv", same)

    def test_the_wheel_has_the_program_and_its_version(self):
        program = pathlib.Path(sys.executable).with_name("curvelax")
        told = subprocess.run([program, "--version"], check=True, capture_output=True, text=True).stdout
        own = subprocess.run([CURVELAX, "--version"], check=True, capture_output=True, text=True).stdout
        self.assertEqual(told, own)
        self.assertEqual(told.split(), ["curvelax", curvelax.__version__])
        self.assertEqual(metadata.version("curvelax"), curvelax.__version__)
        out = self.at / "wheel"
        subprocess.run([program, "run", *FLAGS.split(), "--out", out], check=True)
        self.assertTrue(filecmp.cmp(out / "summary.csv", self.program / "summary.csv", shallow=False))
        wrong = subprocess.run([program, "run", "--curvs", "3"], capture_output=True, text=True)
        self.assertEqual(wrong.returncode, 2)
        self.assertIn("--curves", wrong.stderr)

    def test_accurate_is_the_flag(self):
        flags = "--accurate --points 64 --curves 4 --quiet --backend cpu"
        out = run(flags, self.at / "accurate")
        study = curvelax.run(accurate=True, points=64, curves=4, backend="cpu", progress=False)
        self.assertEqual((out / "summary.csv").read_bytes(), (study.folder / "summary.csv").read_bytes())
        self.assertEqual(study.spec, json.loads((out / "run.json").read_text())["spec"])

    def test_a_spec_file_with_keywords_over_it(self):
        spec = self.at / "spec.toml"
        spec.write_text("curves = 5\nadaptive = 1e-2\nt-end = 0.01\n")
        study = curvelax.run(spec, curves=np.int64(2), tau=np.float64(1e-3), progress=False)
        self.assertEqual((study.spec["curves"], study.spec["tau"], study.spec["t-end"]), (2, 1e-3, 0.01))
        self.assertNotIn("adaptive", study.spec)
        spec.write_text("curves = 5\ncurvs = 2\n")
        with self.assertRaises(curvelax.RequestError) as caught:
            curvelax.run(spec)
        for word in ["spec.toml", "line 2", "did you mean `curves`?"]:
            self.assertIn(word, str(caught.exception))

    # Frames

    def test_frames_have_types_also_where_all_is_missing(self):
        events = self.study.events
        never = events[events.event == "never"]
        self.assertEqual(len(never), 9)
        self.assertEqual(never.censored.tolist(), [1] * 9)
        kinds = {"Int64": pd.api.types.is_integer_dtype, "float64": pd.api.types.is_float_dtype}
        for name in self.study.tables:
            frame, polars = self.study.table(name), self.study.table(name, frames="polars")
            self.assertEqual(list(frame), polars.columns)
            self.assertEqual(len(frame), len(polars))
            for column, (holds, _) in self.study.describe(name).iterrows():
                if holds == "integer":
                    self.assertTrue(kinds["Int64"](frame[column].dtype), f"{name}.{column}")
                    self.assertEqual(polars[column].dtype, pl.Int64, f"{name}.{column}")
                elif holds == "float":
                    self.assertTrue(kinds["float64"](frame[column].dtype), f"{name}.{column}")
                    self.assertEqual(polars[column].dtype, pl.Float64, f"{name}.{column}")
                elif holds == "word":
                    self.assertTrue(pd.api.types.is_string_dtype(frame[column].dtype), f"{name}.{column}")
                    self.assertEqual(polars[column].dtype, pl.String, f"{name}.{column}")
        # Without outlines, no member has a label: a column of text all the same.
        self.assertEqual(self.study.summary.label.tolist(), [""] * 9)
        self.assertTrue(self.study.summary.t_limit.isna().all())

    def test_a_frame_has_all_that_is_known_of_a_member_once(self):
        sweep = {"amplitude": [0.02, 0.08], "flow": ["willmore", "surface-diffusion"]}
        study = curvelax.run(**{**SMALL, "snapshots": [0, 0.01]}, sweep=sweep)
        frame = study.frame()
        self.assertEqual(len(frame), 12)
        self.assertFalse(frame.columns.duplicated().any())
        wanted = {"member", "cell", "amplitude", "flow", *study.table("summary"), *study.table("members")}
        self.assertEqual(set(frame), wanted)
        # Each value is that of its own member and cell, whatever their order.
        cells, members = study.ensemble.set_index("cell"), study.members.set_index("member")
        for _, row in frame.sample(frac=1, random_state=1).iterrows():
            self.assertEqual([row.amplitude, row.flow], cells.loc[row.cell, ["amplitude", "flow"]].tolist())
            self.assertEqual(row.cos_2, members.cos_2[row.member])
        self.assertEqual(study.summary.columns[:4].tolist(), ["member", "cell", "amplitude", "flow"])
        self.assertNotIn("amplitude", study.table("summary"))
        # Swept numbers of nodes are a column already.
        nodes = curvelax.run(**{**SMALL, "points": None}, sweep={"points": [32, 64]})
        self.assertEqual(nodes.summary.points.tolist(), [32] * 3 + [64] * 3)
        # And along the members of arrays, from memory and from files.
        for data in (study.snapshots, curvelax.load(study.folder).snapshots):
            self.assertEqual(data.amplitude.dims, ("member",))
            self.assertEqual(data.amplitude.values.tolist(), study.summary.amplitude.tolist())
            self.assertEqual(data.sel(member=data.flow == "willmore").sizes["member"], 6)
            self.assertIn("swept", data.amplitude.attrs["long_name"])

    def test_parquet_has_the_tables(self):
        for library in ("pyarrow", "polars"):
            missing = {"pyarrow", "polars"} - {library}
            if importlib.util.find_spec(library) is None:
                continue
            find = importlib.util.find_spec
            with unittest.mock.patch("importlib.util.find_spec", lambda name: None if name in missing else find(name)):
                paths = self.study.to_parquet(self.at / f"parquet-{library}")
            self.assertEqual([path.stem for path in paths], self.study.tables)
            for path in paths:
                self.assertTrue(pl.read_parquet(path).equals(self.study.table(path.stem, frames="polars")), path)
        with unittest.mock.patch("importlib.util.find_spec", lambda name: None):
            with self.assertRaises(curvelax.RequestError) as caught:
                self.study.to_parquet(self.at / "none")
        self.assertIn("pip install", str(caught.exception))

    def test_every_bit_of_a_float_is_there(self):
        summary = self.study.summary
        text = pd.read_csv(self.study.folder / "summary.csv", dtype=str)
        self.assertEqual(summary.t_relax.map(float.hex).tolist(), [float(t).hex() for t in text.t_relax])
        polars = self.study.table("summary", frames="polars")
        self.assertEqual(polars["t_relax"].to_list(), summary.t_relax.tolist())
        self.assertNotEqual(np.nextafter(summary.t_relax[0], 9).hex(), float(text.t_relax[0]).hex())

    def test_every_table_is_told(self):
        named = {path.stem for path in self.study.folder.glob("*.csv")}
        self.assertEqual(set(self.study.tables), named)
        self.assertLessEqual({"summary", "members", "ensemble", "events", "series", "snapshots"}, named)
        self.assertEqual(list(self.study.describe("summary").index), list(self.study.summary))
        with self.assertRaises(curvelax.RequestError) as caught:
            self.study.table("groups")
        self.assertIn("group_by=", str(caught.exception))
        with self.assertRaises(curvelax.RequestError) as caught:
            self.study.table("sumary")
        self.assertIn("summary", str(caught.exception))

    # Snapshots

    @unittest.skipUnless(importlib.util.find_spec("zarr"), "zarr 3 needs Python 3.11")
    def test_snapshots_are_the_same_from_memory_from_the_table_and_from_zarr(self):
        stored = curvelax.run(out=self.at / "zarr", progress=False, **KEYS, store="zarr")
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            zarr = xr.open_zarr(stored.folder / "snapshots.zarr", chunks=None).load()
        for name, data in {
            "memory": self.study.snapshots,
            "table": curvelax.load(self.study.folder).snapshots,
            "memory, zarr": stored.snapshots,
            "zarr": curvelax.load(stored.folder).snapshots.load(),
        }.items():
            with self.subTest(name):
                # How snapshots are stored is part of the spec.
                data.attrs["spec"] = data.attrs["spec"].replace('store = "csv"', 'store = "zarr"')
                xr.testing.assert_identical(data, zarr)
        self.assertTrue(np.isnan(zarr.x).any() and not np.isnan(zarr.x).all())
        other = self.study.snapshots.copy(deep=True)
        other.x[3, 1, 4] = np.nextafter(other.x[3, 1, 4], 9)
        self.assertFalse(other.identical(zarr))
        with self.assertRaises(curvelax.RequestError) as caught:
            curvelax.run(**SMALL).snapshots
        self.assertIn("snapshots=[", str(caught.exception))

    # Statistics and pictures

    def test_survival_is_the_product_limit(self):
        curve = self.study.survival()
        times = np.sort(self.study.summary.t_relax)
        self.assertEqual(curve.time.tolist(), [0, *times])
        self.assertEqual(curve.at_risk.tolist(), [9, *range(9, 0, -1)])
        self.assertTrue(np.allclose(curve.survival, np.arange(9, -1, -1) / 9, atol=1e-15))
        self.assertTrue(((curve.lower <= curve.survival) & (curve.survival <= curve.upper)).all())

    def test_one_time_is_shown_and_others_can_be_asked_for(self):
        keys = {**SMALL, "points": 64, "events": {"half": "excess <= 0.5 * start"}}
        raw, refined = curvelax.run(**keys), curvelax.run(**keys, refine=True)
        for study, time in ((raw, "t_relax"), (refined, "t_limit")):
            own = study.survival()
            self.assertEqual((own.attrs["time"], own.time.tolist()[1:]), (time, sorted(study.summary[time])))
            self.assertTrue((study.explained().time == time).all())
            self.assertTrue(study.plot().get_xlabel().startswith(f"{time} ("))
            self.assertIn(f"median {time}", repr(study))
        for time in ("t_relax", "t_half"):
            self.assertEqual(refined.survival(time=time).time.tolist()[1:], sorted(refined.summary[time]))
            self.assertTrue((refined.explained(time=time).time == time).all())
        events = refined.events.t_limit
        self.assertEqual(refined.survival(time="half").time.tolist()[1:], sorted(events))
        self.assertTrue((events != refined.events.t).all() and (refined.events.t_error > 0).all())
        self.assertIn("without half", refined.plot(time="half").get_ylabel())
        for time in ("t_limit", "halb"):
            with self.assertRaises(curvelax.RequestError) as caught:
                raw.survival(time=time)
            self.assertIn("use one of t_relax, t_half, half", str(caught.exception))
            self.assertEqual("refine=True" in str(caught.exception), time == "t_limit")

    def test_plot_draws_a_curve_for_each_cell(self):
        import matplotlib

        matplotlib.use("Agg")
        study = curvelax.run(**SMALL, sweep={"amplitude": [0.02, 0.08]})
        axes = study.plot()
        self.assertEqual([text.get_text() for text in axes.get_legend().get_texts()], ["0.02", "0.08"])
        for line, cell in zip(axes.get_lines(), (0, 1)):
            own = study.summary[study.summary.cell == cell]
            self.assertEqual(line.get_xdata()[1:-1].tolist(), sorted(own.t_relax))
        self.assertEqual(study.plot(axes), axes)
        # A cell in which no member relaxes stays at 1, to the end.
        study = curvelax.run(**SMALL, sweep={"t_end": [0.1, 5]}, units="um,h", mobility=1)
        first = study.plot().get_lines()[0]
        self.assertEqual((first.get_xdata().tolist(), first.get_ydata().tolist()), ([0, 0.1], [1, 1]))
        self.assertEqual(study.plot().get_xlabel(), "t_relax (h)")

    def test_a_study_shows_itself(self):
        self.assertIn("9 relaxed", repr(self.study))
        page = self.study._repr_html_()
        self.assertIn("median t_relax", page)
        self.assertNotIn("<script", page)
        self.assertIn("t_relax    median", self.study.overview)
        self.assertTrue(self.study.pictures["survival"]._repr_svg_().startswith("<svg"))
        self.assertTrue(self.study.report.exists())

    def test_a_picture_is_saved_for_a_paper(self):
        import PIL.Image

        picture = self.study.pictures["survival"]
        with tempfile.TemporaryDirectory() as home:
            out = pathlib.Path(home)
            self.assertEqual(picture.savefig(out / "a.pdf"), out / "a.pdf")
            self.assertTrue((out / "a.pdf").read_bytes().startswith(b"%PDF-1."))
            for name, options, pixels in [
                ("a.png", {}, 2008),
                ("b.PNG", {"width": "page", "dpi": 100}, 669),
                ("c.png", {"width": 127, "dpi": 100}, 500),
            ]:
                with PIL.Image.open(picture.savefig(str(out / name), **options)) as image:
                    self.assertEqual((image.format, image.width), ("PNG", pixels))
            for name, options, said in [
                ("d.jpg", {}, "\".jpg\" is no extension of a picture for papers; use .png or .pdf"),
                ("d", {}, "use .png or .pdf"),
                ("d.pdf", {"dpi": 300}, "dpi=300: a .pdf has no dots; leave it out"),
                ("d.png", {"dpi": 5}, "dpi=5: out of range; use 72 to 1200 dots per inch"),
                ("d.png", {"width": 20}, "width=20: out of range; use column (85 mm), page (170 mm) or 80 to 300 mm"),
                ("d.png", {"width": "colunm"}, "(did you mean `column`?)"),
            ]:
                with self.assertRaises(curvelax.RequestError) as raised:
                    picture.savefig(out / name, **options)
                self.assertIn(said, str(raised.exception))
                self.assertFalse((out / name).exists())

    # Outlines

    def test_arrays_are_outlines(self):
        shapes = {"NA": ellipse(2, 1), "b,c": ellipse(3, 1), "ü": ellipse(1, 1.5).astype("float32")}
        study = curvelax.run(shape=shapes, accurate=True, points=32, backend="cpu", progress=False)
        self.assertEqual(study.summary.label.tolist(), list(shapes))
        self.assertEqual(study.members.label.tolist(), list(shapes))
        listed = curvelax.run(shape=list(shapes.values()), accurate=True, points=32, backend="cpu", progress=False)
        self.assertEqual(listed.summary.t_limit.tolist(), study.summary.t_limit.tolist())
        self.assertEqual(listed.summary.label.tolist(), ["0", "1", "2"])
        # The same by the program, from a file.
        np.savetxt(self.at / "one.csv", shapes["b,c"], delimiter=",", fmt="%.17g")
        flags = f"--shape file:{self.at / 'one.csv'} --accurate --points 32 --curves 1 --amplitude 0 --backend cpu --quiet"
        program = pd.read_csv(run(flags, self.at / "one") / "summary.csv", float_precision=None)
        self.assertEqual(program.t_limit[0], study.summary.t_limit[1])
        one = curvelax.run(shape=shapes["NA"], **SMALL)
        self.assertEqual(len(one.summary), 3)
        path = curvelax.run(shape=self.at / "one.csv", **SMALL)
        self.assertEqual(path.spec["shape"], f"file:{self.at / 'one.csv'}")

    def test_geometries_are_outlines_with_their_labels_and_properties(self):
        """As Shapely and GeoPandas give them, by the interface that they share."""

        class Geometry:
            def __init__(self, interface):
                self.__geo_interface__ = interface

        def polygon(*rings):
            return {"type": "Polygon", "coordinates": [[*map(tuple, ring), tuple(ring[0])] for ring in rings]}

        def times(shape, **keys):
            study = curvelax.run(**{**SMALL, "curves": 1, "amplitude": 0, **keys}, shape=shape)
            self.assertEqual(study.warnings, [])
            return dict(zip(study.summary.label, study.summary.t_relax)), study

        arrays = {"a": ellipse(2, 1), "b": ellipse(1.5, 1)}
        wanted, _ = times(arrays)
        geometries = {label: Geometry(polygon(points)) for label, points in arrays.items()}
        with warnings.catch_warnings():
            # Coordinates of a plane need no note, though they could be degrees.
            warnings.simplefilter("error", curvelax.CurvelaxWarning)
            found, _ = times(geometries)
        self.assertEqual(found, wanted)
        rings = {label: Geometry({**polygon(points), "type": "LinearRing"}) for label, points in arrays.items()}
        for ring, points in zip(rings.values(), arrays.values()):
            ring.__geo_interface__["coordinates"] = ring.__geo_interface__["coordinates"][0]
        self.assertEqual(times(rings)[0], wanted)
        features = [
            {"type": "Feature", "id": label, "properties": {"kind": np.int64(i), "day": np.datetime64("2026-01-01")},
             "geometry": polygon(points), "bbox": (0, 0, 1, 1)}
            for i, (label, points) in enumerate(arrays.items())
        ]
        frame = Geometry({"type": "FeatureCollection", "features": features})
        found, study = times(frame, group_by="kind")
        self.assertEqual(found, wanted)
        self.assertEqual(study.summary.group.tolist(), ["0", "1"])
        # Degrees are projected, if a frame says that they are.
        frame.crs = type("Crs", (), {"is_geographic": True})
        with self.assertWarnsRegex(curvelax.CurvelaxWarning, r"^shape: feature 1 \(`a`\): lon,lat projected"):
            far = curvelax.run(**{**SMALL, "curves": 1, "amplitude": 0}, shape=frame).summary.t_relax
        self.assertGreater(far[0], 1e6)
        # Many members of one outline, as for an array.
        both = [curvelax.run(**SMALL, shape=shape).summary.t_relax.tolist() for shape in (ellipse(2, 1), geometries["a"])]
        self.assertEqual(*both)
        self.assertEqual(len(set(both[0])), 3)
        for shape, words in [
            (Geometry(polygon(ellipse(2, 1), ellipse(0.5, 0.5))), ["shape", "hole"]),
            (Geometry({"type": "Point", "coordinates": (0, 0)}), ["shape", "Point"]),
            (Geometry({"type": "LineString", "coordinates": [(0, 0), (1, 0), (1, 1)]}), ["shape: feature 1 is an open line"]),
            ([geometries["a"], ellipse(2, 1)], ["shape['1']", "arrays and geometries"]),
            ({1: geometries["a"], "1": geometries["b"]}, ["two outlines have the same label"]),
            ({1: ellipse(2, 1), "1": ellipse(3, 1)}, ["two outlines have the same label"]),
        ]:
            message = self.refused(*words, shape=shape)
            self.assertNotIn("/", message.replace("n/2", ""), "a path of a file that no user wrote")

    def test_contours_of_opencv_are_outlines(self):
        contour = np.round(1000 * ellipse(2, 1, 200)).astype(np.int32)
        keys = {**SMALL, "curves": 1, "amplitude": 0}
        wanted = curvelax.run(**keys, shape=contour).summary
        for shape in (contour[:, np.newaxis], [contour[:, np.newaxis]], (contour[:, np.newaxis],)):
            self.assertEqual(curvelax.run(**keys, shape=shape).summary.t_relax.tolist(), wanted.t_relax.tolist())
        # Three axes are otherwise several outlines.
        self.assertEqual(len(curvelax.run(**keys, shape=np.stack([contour, 2 * contour])).summary), 2)

    def test_numbers_of_members_are_arrays_and_laws_of_scipy(self):
        keys = {**SMALL, "curves": None}
        sizes = np.array([0.02, 0.1, 0.05, 0.03])
        study = curvelax.run(**keys, amplitude=sizes)
        self.assertEqual(study.members.amplitude.tolist(), sizes.tolist())
        self.assertEqual(curvelax.run(**keys, amplitude=pd.Series(sizes)).members.amplitude.tolist(), sizes.tolist())
        self.refused("3 values for 5 members", curves=5, amplitude=[0.1, 0.2, 0.3])
        self.refused("amplitude", "empty", amplitude=[])
        from scipy import stats

        for law, text in [
            (stats.uniform(0.01, 0.04), "uniform(0.01..0.05)"),
            (stats.norm(0.1, scale=0.01), "normal(0.1,0.01)"),
            (stats.lognorm(0.2, scale=0.05), "lognormal(0.05,0.2)"),
            (stats.halfnorm(scale=0.02), "halfnormal(0.02)"),
            (stats.gamma(40, scale=0.001), "gamma(40,0.001)"),
            (stats.weibull_min(3, scale=0.05), "weibull(3,0.05)"),
        ]:
            self.assertEqual(curvelax.run(**SMALL, amplitude=law).spec["amplitude"], text)
        # Any other by its quantiles.
        law = stats.beta(2, 5, scale=0.3)
        drawn = curvelax.run(**{**SMALL, "curves": 2000, "t_end": 1e-4, "stop_when_relaxed": None}, amplitude=law).members.amplitude
        self.assertGreater(stats.kstest(drawn, law.cdf).pvalue, 1e-3)
        self.assertLess(stats.kstest(drawn, stats.beta(2, 4, scale=0.3).cdf).pvalue, 1e-3)

    def test_outlines_stay_with_their_run(self):
        out = self.at / "outlines"
        study = curvelax.run(shape=[ellipse(2, 1), ellipse(1, 3)], out=out, **{**SMALL, "curves": 2})
        self.assertEqual(len(study.summary), 4)
        with np.load(out / "outlines.npz") as saved:
            self.assertTrue(np.array_equal(saved["1"], ellipse(1, 3)))
        self.assertEqual(len(curvelax.resume(out).summary), 4)
        with self.assertRaises(curvelax.RequestError) as caught:
            curvelax.run(shape=[ellipse(2, 1)], out=out, **SMALL)
        self.assertIn("outlines", str(caught.exception))
        again = curvelax.run(shape=[ellipse(2, 1), ellipse(1, 2), ellipse(1, 4)], out=out, force=True, **{**SMALL, "curves": 1})
        self.assertEqual(len(again.summary), 3)

    def test_wrong_arrays_are_refused_in_clear_words(self):
        ring = ellipse(2, 1)
        nan = ring.copy()
        nan[7, 1] = np.nan
        out = self.at / "refused"
        for words, shape in [
            (("point 7", "nan"), nan),
            (("shape[1]", "point 7"), None),
            (("(60, 3)", "(N, 2)"), np.c_[ring, ring[:, 0]]),
            (("2 points", "at least 3"), ring[:2]),
            (("type <U1", "real numbers"), np.full((9, 2), "a")),
            (("complex", "real numbers"), ring.astype(complex)),
            (("type bool",), ring > 0),
            (("no outlines",), []),
            (("no outlines",), {}),
            (("no array",), [[(0, 0), (1, 0), (1,)]]),
            (("int is no outline",), 7),
            (("no net area",), np.array([[0, 0], [1, 1], [1, 0], [0, 1.0]])),
        ]:
            with self.subTest(words=words):
                keys = {"shape": {"0": ring, "1": nan} if shape is None else shape}
                expected = ("'1'", "point 7") if shape is None else words
                self.refused(*expected, **keys, out=out)
                self.assertFalse(out.exists())
        with self.assertRaises(curvelax.RequestError):
            curvelax.run(sweep={"shape": [ring]}, out=out)

    def test_frames_and_masked_arrays_are_read_as_they_are_meant(self):
        x, y = ellipse(2, 1).T
        keys = {**SMALL, "curves": 1, "amplitude": 0}
        plain = curvelax.run(shape=np.c_[x, y], **keys).summary
        for frame in [pd.DataFrame({"y": y, "X": x, "id": 1}), pd.DataFrame({"a": x, "b": y}), pl.DataFrame({"x": x, "y": y})]:
            self.assertTrue(curvelax.run(shape=frame, **keys).summary.equals(plain))
        self.assertFalse(curvelax.run(shape=pd.DataFrame({"x": x, "y": 2 * y}), **keys).summary.equals(plain))
        masked = np.ma.array(np.c_[x, y])
        self.assertTrue(curvelax.run(shape=masked, **keys).summary.equals(plain))
        masked[5:9] = np.ma.masked
        self.refused("masked", shape=masked)
        self.refused("columns a, b, c", shape=pd.DataFrame({"a": x, "b": y, "c": y}))

    def test_nothing_given_is_lost(self):
        out = self.at / "lost"
        for words, keys in [
            ("event: given twice", {"events": {"a": "excess <= 1"}, "event": ["b = excess <= 1"]}),
            ("points is given, too", {"points": 64, "sweep": {"points": [32, 40]}}),
            ("adaptive is given, too", {"adaptive": 1e-3, "sweep": {"tau": [1e-3, 1e-4]}}),
            ("two names of one key", {"t-end": 1, "t_end": 2}),
            ("two names of one key", {"sweep": {"t-end": [1], "t_end": [2]}}),
            ("only named shapes", {"shape": ellipse(2, 1), "sweep": {"shape": ["circle:1"]}}),
            ("only named shapes", {"sweep": {"shape": np.zeros((2, 9, 2))}}),
            ("sweep={'shape'", {"shape": ["circle:1", "circle:2"]}),
        ]:
            with self.subTest(words=words):
                self.refused(words, **keys, out=out)
                self.assertFalse(out.exists())
        spec = self.at / "swept.toml"
        spec.write_text("[sweep]\namplitude = [0.02, 0.04]\n")
        study = curvelax.run(spec, **{**SMALL, "points": None}, sweep={"points": [32, 40]})
        self.assertEqual(study.ensemble[["amplitude", "points"]].to_numpy().tolist(), [[0.02, 32], [0.02, 40], [0.04, 32], [0.04, 40]])
        self.assertEqual(curvelax.run(**{**SMALL, "adaptive": True}).spec["adaptive"], 1e-3)

    def test_a_refused_run_leaves_a_folder_as_it_was(self):
        out = self.at / "as it was"
        curvelax.run(shape=ellipse(2, 1), out=out, **SMALL)
        before = {name: (out / name).read_bytes() for name in files(out)}
        for keys in [{"typo": 1}, {"curves": object()}]:
            self.refused(shape=ellipse(3, 1), out=out, force=True, **keys)
            self.assertEqual({name: (out / name).read_bytes() for name in files(out)}, before)
        curvelax.run(shape=ellipse(3, 1), out=out, force=True, **SMALL)
        self.assertEqual(files(out), sorted(before))
        self.assertNotEqual((out / "outlines.npz").read_bytes(), before["outlines.npz"])

    def test_force_replaces_a_run_and_nothing_else(self):
        out = self.at / "forced"
        out.mkdir()
        curvelax.run(shape=ellipse(2, 1), out=out, force=True, **SMALL)
        (out / "notes.txt").write_text("mine")
        before = {name: (out / name).read_bytes() for name in files(out)}
        for shape in [ellipse(3, 1), "ellipse:3,1"]:
            self.assertIn("notes.txt", self.refused(shape=shape, out=out, force=True))
            self.assertEqual({name: (out / name).read_bytes() for name in files(out)}, before)

    def test_a_study_stays_with_its_folder(self):
        study = curvelax.run(out=os.path.relpath(self.at / "relative"), **SMALL)
        elsewhere = pickle.loads(pickle.dumps(study))
        before = os.getcwd()
        os.chdir(self.at)
        try:
            self.assertTrue(study.folder.is_absolute() and elsewhere.summary.equals(study.summary))
        finally:
            os.chdir(before)
        with unittest.mock.patch.dict(os.environ, {"HOME": str(self.at)}):
            self.assertEqual(curvelax.run(out="~/home", **SMALL).folder, self.at / "home")
        # A child that ends leaves its parent's results alone.
        temporary = curvelax.run(**SMALL)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            child = os.fork()
        if child == 0:
            try:
                curvelax.run(**SMALL)
            except curvelax.RequestError as error:
                temporary._finalizer()
                os._exit(7 if "spawn" in str(error) else 1)
            os._exit(2)
        self.assertEqual(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), 7)
        self.assertEqual(len(temporary.summary), 3)

    def test_snapshots_of_cells_with_other_nodes_and_of_a_damaged_table(self):
        keys = {**SMALL, "points": None, "sweep": {"points": [32, 40]}, "snapshots": [0, 0.05]}
        study = curvelax.run(out=self.at / "nodes", **keys)
        loaded = curvelax.load(study.folder)
        xr.testing.assert_identical(study.snapshots, loaded.snapshots)
        self.assertEqual(study.snapshots.sizes["node"], 40)
        path = study.folder / "snapshots.csv"
        path.write_text("".join(path.read_text().splitlines(keepends=True)[:100]))
        with self.assertRaises(curvelax.RunError) as caught:
            curvelax.load(study.folder).snapshots
        self.assertIn("incomplete", str(caught.exception))

    def test_warnings_may_be_errors(self):
        with warnings.catch_warnings():
            warnings.simplefilter("error", curvelax.CurvelaxWarning)
            with self.assertRaises(curvelax.CurvelaxWarning):
                curvelax.run(shape=[ellipse(2, 1), ellipse(1, 3)], **SMALL)

    def test_wrong_keys_are_refused_with_the_nearest_one(self):
        out = self.at / "keys"
        self.refused("curvs", "did you mean `curves`?", curvs=3, out=out)
        self.refused("points", points=2, out=out)
        self.refused("did you mean `excess`?", events={"a": "exces <= 1"}, out=out)
        self.refused("amplitude", amplitude=float("nan"), out=out)
        self.refused("nofile.csv", shape="file:nofile.csv", out=out)
        self.refused("curves", "neither a number", curves=object(), out=out)
        self.assertTrue(self.refused(curves=3.5, out=out).startswith("curves = 3.5: "))
        self.assertFalse(out.exists())
        for folder, word in [(self.study.folder, "exist"), (self.at / "nowhere", "no")]:
            call = curvelax.load if word == "no" else lambda out: curvelax.run(**SMALL, out=out)
            with self.assertRaises(curvelax.RequestError) as caught:
                call(folder)
            self.assertIn(word, str(caught.exception))

    # Long runs

    def test_a_run_lets_other_threads_work_and_tells_its_progress(self):
        counted, told, done = [0], [], threading.Event()

        def count():
            while not done.wait(0.001):
                counted[0] += 1

        thread = threading.Thread(target=count)
        thread.start()
        keys = {**SMALL, "curves": 4000, "threads": 1, "progress": lambda *state: told.append(state)}
        curvelax.run(**keys)
        done.set()
        thread.join()
        self.assertGreater(counted[0], 5)
        shares = [share for _, _, share in told]
        self.assertEqual(shares, sorted(shares))
        # Members at coarser resolutions count, too.
        self.assertEqual(told[-1][2], 1)
        self.assertTrue(told and all(done <= total and total >= 4000 for done, total, _ in told))

    def test_what_progress_raises_ends_the_run(self):
        def fail(*_):
            raise ZeroDivisionError("mine")

        with self.assertRaises(ZeroDivisionError):
            curvelax.run(**{**SMALL, "curves": 100_000, "progress": fail})

    def test_messages_name_keywords_and_not_flags(self):
        self.assertRegex(self.refused(points=5), r"^points=5: .* use 6 to")
        self.assertIn("use points=160 or more", self.refused(modes="2..=40", points=40))
        self.assertIn("did you mean `t_end`?", self.refused(t_ed=3))
        self.assertNotIn("`t-end`", self.refused(t_ed=3))
        with self.assertWarns(curvelax.CurvelaxWarning) as caught:
            study = curvelax.run(**{**SMALL, "t_end": 0.01})
        self.assertIn("use a longer t_end, or a larger relax_to", str(caught.warning))
        self.assertEqual(study.warnings, [str(caught.warning)])
        # Where the user's line is, not one of the package.
        self.assertEqual(caught.filename, __file__)

    def test_whole_floats_are_integers(self):
        study = curvelax.run(**{**SMALL, "curves": 3.0, "points": np.float64(32), "t_end": 5.0})
        self.assertEqual((study.spec["curves"], study.spec["points"], study.spec["t-end"]), (3, 32, 5.0))
        self.assertIn("2.5", self.refused(curves=2.5))

    def test_progress_without_tqdm_is_a_line(self):
        shown = io.StringIO()
        shown.isatty = lambda: True
        with unittest.mock.patch.dict(sys.modules, {"tqdm.auto": None}), contextlib.redirect_stderr(shown):
            curvelax.run(**{**SMALL, "progress": True, "curves": 2000})
            curvelax.run(**{**SMALL, "progress": None, "curves": 2000})
        lines = shown.getvalue().split("\r")
        self.assertRegex(lines[1], r"^ *\d+ % \d+ of 2000 runs$")
        self.assertEqual((lines[-2].strip(), lines[-1]), ("", ""))
        self.assertNotIn("\n", shown.getvalue())

    def test_an_interrupted_run_leaves_what_ended_and_is_resumed(self):
        out = self.at / "interrupted"
        # A job in the background ignores Ctrl-C.
        self.addCleanup(signal.signal, signal.SIGINT, signal.signal(signal.SIGINT, signal.default_int_handler))
        # More than a thread computes at once: some end long before others begin.
        keys = {**SMALL, "curves": 2000, "threads": 1}
        whole = curvelax.run(**keys)

        def interrupt(done, *_):
            # Longer than the time between two calls, so every dispatch is followed by one, however fast it is.
            time.sleep(0.1)
            if done >= 20:
                os.kill(os.getpid(), signal.SIGINT)

        with self.assertRaises(KeyboardInterrupt) as caught:
            curvelax.run(**{**keys, "progress": interrupt}, out=out)
        self.assertIsInstance(caught.exception, curvelax.Interrupted)
        self.assertEqual(caught.exception.folder, out)
        self.assertRegex(str(caught.exception), r"stopped by Ctrl-C after .* of 2000 members finished; curvelax\.resume\('")
        # The interpreter lives, and so does its own Ctrl-C.
        with self.assertRaises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
            threading.Event().wait(HANGS)
        with self.assertRaises(curvelax.RequestError):
            curvelax.load(out)
        resumed = curvelax.resume(out, progress=False)
        self.assertEqual((out / "summary.csv").read_bytes(), (whole.folder / "summary.csv").read_bytes())
        self.assertTrue(resumed.summary.equals(whole.summary))

    def test_a_temporary_folder_goes_with_its_study_and_can_be_saved(self):
        study = curvelax.run(**SMALL)
        folder = study.folder
        kept = study.save(self.at / "kept")
        self.assertTrue(folder.exists())
        with self.assertRaises(curvelax.RequestError):
            study.save(kept)
        del study
        self.assertFalse(folder.exists())
        self.assertEqual(len(curvelax.load(kept).summary), 3)

    def test_warnings_of_a_run_are_warnings_of_python(self):
        with self.assertWarns(curvelax.CurvelaxWarning) as caught:
            study = curvelax.run(shape=[ellipse(2, 1), ellipse(1, 3)], **SMALL)
        self.assertIn("copies of one outline", str(caught.warning))
        self.assertEqual(pathlib.Path(caught.filename).name, "test_package.py")
        self.assertEqual(study.warnings, [str(caught.warning)])

    # Documents

    def test_the_examples_in_the_documents_run(self):
        found = 0
        with tempfile.TemporaryDirectory() as home:
            before = os.getcwd()
            os.chdir(home)
            try:
                for path in [ROOT / "python/README.md"]:
                    failed, tried = doctest.testfile(str(path), module_relative=False, optionflags=doctest.ELLIPSIS)
                    self.assertEqual(failed, 0, path)
                    found += tried
                for module in [curvelax, sys.modules["curvelax._run"]]:
                    failed, tried = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
                    self.assertEqual(failed, 0, module)
                    found += tried
            finally:
                os.chdir(before)
        self.assertGreater(found, 15)

    def names_of(self, page, figure):
        """The names that the blocks of a page define; its figure is a picture."""
        import matplotlib

        matplotlib.use("Agg")
        blocks = re.findall(r"^```python\n(.*?)^```$", (ROOT / page).read_text(), re.DOTALL | re.MULTILINE)
        self.assertGreater(len(blocks), 5)
        names = {}
        before = os.getcwd()
        with tempfile.TemporaryDirectory() as home:
            (pathlib.Path(home) / "examples").symlink_to(ROOT / "examples")
            os.chdir(home)
            try:
                for block in blocks:
                    with contextlib.redirect_stdout(io.StringIO()) as told:
                        exec(block, names)  # noqa: S102
                    print(told.getvalue(), end="")
                self.assertEqual(pathlib.Path(figure).read_bytes()[:4], b"\x89PNG")
                if "KEEP_FIGURE" in os.environ:
                    shutil.copy(figure, os.environ["KEEP_FIGURE"])
            finally:
                os.chdir(before)
        return names

    def test_the_tutorial_runs_to_its_figure(self):
        names = self.names_of("docs/tutorial.md", "jamaica.png")
        cells, coast = names["cells"], names["coast"]
        self.assertEqual(cells.relaxed.tolist(), [32, 32, 32])
        # What the text says of the bars.
        half = (cells.t_limit_median_high - cells.t_limit_median_low) / 2
        self.assertTrue((cells.t_limit_error < half).all())
        self.assertTrue((coast.t_error < 0.1 * coast.t_limit) and not names["best"].empty)

    def test_the_study_of_an_image_runs_to_its_figure(self):
        names = self.names_of("docs/segmentation.md", "coins.png")
        particle, best = names["particle"], names["best"]
        self.assertEqual((len(particle), set(particle.status)), (23, {"relaxed"}))
        self.assertEqual(particle.index.tolist(), list(names["particles"]))
        # What the text says: elongation explains most, size little, and the bars are small.
        self.assertEqual(best.feature.iloc[0], "descriptor_2")
        self.assertGreater(best.spearman.iloc[0], 0.9)
        self.assertLess(abs(particle.area_start.corr(particle.t_limit, method="spearman")), 0.3)
        self.assertTrue((names["share"].median() < 0.01).all())

    def test_the_reference_is_that_of_the_package(self):
        page = reference.PAGE.read_text(encoding="utf-8")
        self.assertEqual(page, reference.page(), "python tests/python/reference.py rewrites it")
        for name in curvelax.__all__:
            self.assertIn(f"## `curvelax.{name}", page)

    def test_types_are_told_to_checkers(self):
        own = resources.files("curvelax")
        self.assertTrue((own / "py.typed").is_file())
        stubs = (own / "_curvelax.pyi").read_text()
        for name in ["FinishedRun", "SnapshotBuffer", "run", "resume", "main", "check_place"]:
            self.assertIn(name, stubs)
            self.assertTrue(hasattr(sys.modules["curvelax._curvelax"], name), name)


if __name__ == "__main__":
    unittest.main()
