"""examples/python/study.py runs, and finds what theory says."""

import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import matplotlib.image

from common import CURVELAX

STUDY = Path(__file__).parents[2] / "examples" / "python" / "study.py"


class Examples(unittest.TestCase):
    def study(self, home, *arguments):
        # An empty PATH: the program is the one named, and no other.
        return subprocess.run(
            [sys.executable, str(STUDY), "--out", str(home), "--curves", "16", *arguments],
            capture_output=True, text=True, env={**os.environ, "PATH": ""},
        )

    def test_the_study_leaves_a_figure_and_the_slope_of_theory(self):
        with tempfile.TemporaryDirectory() as home:
            done = self.study(home, "--curvelax", CURVELAX)
            self.assertEqual(done.returncode, 0, done.stderr)
            slope = float(re.search(r"slope .*: (\S+) \(standard error", done.stdout)[1])
            # The nodes and steps of the study are worth a few per cent; 1/9 or 1/16, of other modes, are far off.
            self.assertLess(abs(12 * slope - 1), 0.03, done.stdout)
            picture = matplotlib.image.imread(Path(home) / "study.png")
            self.assertEqual(picture.shape[:2], (600, 1800))
            # Each of the three panels has ink.
            for panel in (picture[:, :600], picture[:, 600:1200], picture[:, 1200:]):
                self.assertGreater((panel[..., :3].min(axis=2) < 0.5).mean(), 0.005)

    def test_a_program_that_is_not_there_or_fails_ends_the_study(self):
        with tempfile.TemporaryDirectory() as home:
            done = self.study(home, "--curvelax", CURVELAX, "--curves", "0")
            self.assertEqual(done.returncode, 1)
            self.assertIn("curvelax ended with exit code 2", done.stderr)
            self.assertFalse((Path(home) / "study.png").exists())


if __name__ == "__main__":
    unittest.main()
