"""members.csv and explained.csv of the default ensemble, computed again with numpy from the nodes at the start."""

import tempfile
import unittest
from pathlib import Path

import numpy as np
import pandas as pd

from common import run

# The ensemble of `curvelax run` without flags, with its nodes at the start.
FLAGS = "--snapshots 0 --backend cpu --quiet"
MODES = range(2, 9)


def coefficients(x, y):
    """The coefficients of cos mθ and sin mθ of a perturbed 2:1 ellipse: the radius over that of the ellipse, less 1,
    fitted at the angles of the nodes."""
    angle = np.arctan2(y, x)
    ellipse = 1 / np.hypot(np.cos(angle) / 2, np.sin(angle))
    waves = np.column_stack([of(m * angle) for m in MODES for of in (np.cos, np.sin)])
    found, *_ = np.linalg.lstsq(waves, np.hypot(x, y) / ellipse - 1, rcond=None)
    return found


def descriptors(x, y, count=1 << 13):
    """Fourier descriptors of the polygon, by a fast Fourier transform of points at equal distances along it."""
    z = np.append(x + 1j * y, x[0] + 1j * y[0])
    s = np.concatenate([[0], np.cumsum(np.abs(np.diff(z)))])
    at = np.arange(count) * s[-1] / count
    size = np.abs(np.fft.fft(np.interp(at, s, z.real) + 1j * np.interp(at, s, z.imag)))
    return [np.hypot(size[1 + k], size[1 - k]) / size[1] for k in MODES]


class Explained(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        home = tempfile.TemporaryDirectory()
        cls.addClassCleanup(home.cleanup)
        out = run(FLAGS, Path(home.name) / "out")
        names = ("summary", "members", "explained", "snapshots")
        cls.summary, cls.members, cls.explained, nodes = (pd.read_csv(out / f"{name}.csv") for name in names)
        cls.nodes = [(of.x.to_numpy(), of.y.to_numpy()) for _, of in nodes.groupby("member")]

    def test_features_are_those_of_the_nodes(self):
        names = [f"{of}_{m}" for m in MODES for of in ("cos", "sin")]
        waves = np.array([coefficients(x, y) for x, y in self.nodes])
        self.assertEqual(waves.shape, (256, 14))
        self.assertLess(np.abs(waves - self.members[names].to_numpy()).max(), 1e-9)
        shapes = np.array([descriptors(x, y) for x, y in self.nodes])
        own = self.members[[f"descriptor_{k}" for k in MODES]].to_numpy()
        self.assertLess(np.abs(shapes - own).max(), 1e-5)
        # The control: the comparison sees another member.
        self.assertGreater(np.abs(waves[1:] - self.members[names].to_numpy()[:-1]).max(), 1e-3)

    def test_cos_2_is_named_first_with_its_share(self):
        cos_2 = np.array([coefficients(x, y)[0] for x, y in self.nodes])
        for time in ("t_relax", "t_half"):
            t = self.summary[time]
            first = self.explained[self.explained.time == time].iloc[0]
            self.assertEqual((first.feature, first.members, first.censored), ("cos_2", 256, 0))
            self.assertAlmostEqual(first.r2, np.corrcoef(cos_2, t)[0, 1] ** 2, delta=1e-9)
            self.assertAlmostEqual(first.spearman, self.members.cos_2.rank().corr(t.rank()), delta=1e-12)
        self.assertGreater(self.explained.r2.iloc[0], 0.9)

    def test_every_feature_has_its_share(self):
        for row in self.explained.itertuples():
            if row.feature != "together":
                x, t = self.members[row.feature], self.summary[row.time]
                self.assertAlmostEqual(row.r2, np.corrcoef(x, t)[0, 1] ** 2, delta=1e-9)
                self.assertAlmostEqual(row.spearman, x.rank().corr(t.rank()), delta=1e-9)

    def test_the_regression_explains_more_than_one_feature(self):
        of = self.explained[self.explained.time == "t_relax"]
        chosen = of[of.chosen.notna() & (of.feature != "together")].sort_values("chosen").feature.tolist()
        together = of[of.feature == "together"].iloc[0]
        self.assertEqual(len(chosen), together.chosen)
        x = np.column_stack([np.ones(256), self.members[chosen]])
        t = self.summary.t_relax.to_numpy()
        solution, *_ = np.linalg.lstsq(x, t, rcond=None)
        fitted = 1 - np.sum((t - x @ solution) ** 2) / np.sum((t - t.mean()) ** 2)
        # Cross-validated, it is a little smaller.
        self.assertTrue(fitted - 0.02 < together.r2 < fitted, (fitted, together.r2))


if __name__ == "__main__":
    unittest.main()
