"""Regions of ImageJ as outlines, in files that roifile writes."""

import sys
import tempfile
import unittest
import unittest.mock
from pathlib import Path

import numpy as np
import roifile

import curvelax

ROI = roifile.ROI_TYPE
SMALL = {"curves": 1, "amplitude": 0, "points": 24, "adaptive": 1e-3, "stop_when_relaxed": True, "progress": False}


def ellipse(a, b, count=40):
    angles = 2 * np.pi * np.arange(count) / count
    return np.stack([60 + a * np.cos(angles), 50 + b * np.sin(angles)], axis=1)


def drawn(points, name, kind=ROI.FREEHAND):
    region = roifile.ImagejRoi.frompoints(points, name=name)
    region.roitype = kind
    return region


def boxed(kind, name, **more):
    """A region that its rectangle says."""
    region = roifile.ImagejRoi()
    region.roitype, region.name = kind, name
    region.top, region.left, region.bottom, region.right = 10, 20, 50, 100
    for key, value in more.items():
        setattr(region, key, value)
    return region


class Regions(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.at = Path(folder.name)

    def file(self, name, *regions):
        path = self.at / name
        if path.suffix == ".zip":
            # ImageJ's own names of the parts are apart, even if those of the regions are not.
            roifile.roiwrite(path, regions, name=[f"{place}.roi" for place in range(len(regions))])
        else:
            regions[0].tofile(path)
        return path

    def starts(self, shape):
        """Area at the start by label."""
        study = curvelax.run(**SMALL, shape=shape)
        self.assertEqual(study.warnings, [])
        table = study.summary
        return dict(zip(table.label, table.area_start))

    def test_regions_are_the_same_outlines_as_their_arrays(self):
        big, small = ellipse(40.25, 20), ellipse(20.5, 10)
        smalls = [drawn(small, "small", kind) for kind in (ROI.POLYGON, ROI.TRACED)]
        path = self.file("cells.zip", drawn(big, "big"), *smalls)
        # Coordinates of ImageJ are in f32.
        arrays = {"big": big.astype("f4"), "small": small.astype("f4"), "small (2)": small.astype("f4")}
        self.assertEqual(self.starts(path), self.starts(arrays))
        self.assertEqual(self.starts(f"file:{path}"), self.starts(path))
        self.assertNotEqual(self.starts({**arrays, "big": small}), self.starts(arrays))

    def test_one_region_and_whole_pixels(self):
        square = np.array([[10, 10], [50, 10], [50, 30], [10, 30]])
        path = self.file("one.ROI", drawn(square, "", ROI.POLYGON))
        self.assertEqual(self.starts(path), {"one": self.starts({"one": square})["one"]})

    def test_rectangles_and_ovals(self):
        found = self.starts(self.file("boxes.zip", boxed(ROI.RECT, "box"), boxed(ROI.OVAL, "oval")))
        self.assertAlmostEqual(found["box"] / (80 * 40), 1, delta=0.05)
        self.assertAlmostEqual(found["oval"] / (np.pi * 40 * 20), 1, delta=0.05)

    def test_what_is_no_closed_curve_is_refused_by_name_and_kind(self):
        line = drawn(ellipse(40, 20), "axis", ROI.POLYLINE)
        text = boxed(ROI.RECT, "label", subtype=roifile.ROI_SUBTYPE.TEXT)
        rounded = boxed(ROI.RECT, "soft", rounded_rect_arc_size=9)
        composite = boxed(ROI.RECT, "ring", multi_coordinates=np.array([0, 1, 1, 1, 9, 1, 1, 9, 9, 4], "f4"))
        for region, words in [
            (line, "'axis' is a polyline"),
            (drawn([[5, 5], [9, 9]], "dots", ROI.POINT), "'dots' is a point"),
            (text, "'label' is a text"),
            (rounded, "'soft' is a rounded rect"),
            (composite, "'ring' is a composite"),
            (drawn([[5, 5], [9, 9]], "two"), "shape['two']: 2 points"),
        ]:
            with self.subTest(words), self.assertRaisesRegex(curvelax.RequestError, words.replace("[", r"\[")):
                found = [drawn(ellipse(9, 5), "a"), region]
                with unittest.mock.patch.object(roifile.ImagejRoi, "fromfile", return_value=found):
                    self.starts(self.at / "all.zip")

    def test_what_is_no_file_of_imagej_is_refused(self):
        for name, content in [("a.roi", b"hello"), ("b.zip", b"PK")]:
            (self.at / name).write_bytes(content)
            with self.subTest(name), self.assertRaisesRegex(curvelax.RequestError, f"{name}: it cannot be read"):
                self.starts(self.at / name)
        with self.assertRaisesRegex(curvelax.RequestError, "none.roi: it cannot be read"):
            self.starts(self.at / "none.roi")

    def test_without_roifile_the_command_that_installs_it_is_named(self):
        path = self.file("cells.zip", drawn(ellipse(40, 20), "a"))
        with unittest.mock.patch.dict(sys.modules, {"roifile": None}):
            with self.assertRaisesRegex(curvelax.RequestError, "pip install roifile"):
                self.starts(path)
            # Other files need none.
            np.save(self.at / "one.npy", ellipse(40, 20))
            self.assertEqual(len(self.starts(self.at / "one.npy")), 1)


if __name__ == "__main__":
    unittest.main()
