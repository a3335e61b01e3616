"""docs/internals/scale.md shows what examples/python/makespan.py prints, and that plays a queue as it should."""

import argparse
import importlib.util
import math
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

from common import CURVELAX

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "examples" / "python" / "makespan.py"
PAGE = (ROOT / "docs" / "internals" / "scale.md").read_text()

loaded = importlib.util.spec_from_file_location("makespan", SCRIPT)
makespan = importlib.util.module_from_spec(loaded)
loaded.loader.exec_module(makespan)


def options(**changed):
    """Two slots, each a node, that begin at once and keep a state every quarter of an hour."""
    plain = {"nodes": 2, "threads": 1, "start": 0.0, "requeue": 1800.0, "checkpoint": 900.0}
    return argparse.Namespace(**plain | changed)


def never(nodes):
    return np.full((nodes, 1), np.inf)


class Page(unittest.TestCase):
    def test_tables_are_those_that_the_commands_print(self):
        simulations = re.findall(r"^    python (examples/python/makespan\.py pilot/summary\.csv.*)$", PAGE, re.MULTILINE)
        self.assertGreaterEqual(len(simulations), 2)
        with tempfile.TemporaryDirectory() as home:
            pilot = re.search(r"^    curvelax (run .* --out pilot)$", PAGE, re.MULTILINE)[1]
            self.assertIn(pilot, makespan.__doc__)
            subprocess.run([CURVELAX, *pilot.split(), "--quiet"], check=True, cwd=home)

            def printed(line):
                script, *flags = line.split()
                command = [sys.executable, ROOT / script, *flags]
                return subprocess.run(command, check=True, capture_output=True, text=True, cwd=home).stdout.strip()

            for line in simulations:
                self.assertIn(printed(line), PAGE, line)
            # Another seed prints something else.
            self.assertNotIn(printed(simulations[0] + " --seed 2"), PAGE)


class Queue(unittest.TestCase):
    def test_equal_shards_fill_equal_slots(self):
        end, lost = makespan.play([1.0] * 6, [1.0, 1.0], never(2), options(), True)
        self.assertEqual((end, lost), (3.0, 0.0))
        end, _ = makespan.play([1.0] * 7, [1.0, 1.0], never(2), options(), True)
        self.assertEqual(end, 4.0)
        # With six minutes to begin each.
        self.assertAlmostEqual(makespan.play([1.0] * 6, [1.0, 1.0], never(2), options(start=360.0), True)[0], 3.3)

    def test_a_fast_node_takes_more_shards(self):
        self.assertEqual(makespan.play([1.0] * 6, [2.0, 1.0], never(2), options(), True)[0], 2.0)

    def test_a_failure_costs_the_work_since_the_last_state_or_all_of_it(self):
        # One slot: 0.6 h of 1 are done when it fails, 0.5 of them are kept; it is back at 1.1 h.
        one = options(nodes=1)
        failures = np.array([[0.6, np.inf]])
        end, lost = makespan.play([1.0], [1.0], failures, one, True)
        self.assertAlmostEqual(end, 1.6)
        self.assertAlmostEqual(lost, 0.1)
        end, lost = makespan.play([1.0], [1.0], failures, one, False)
        self.assertAlmostEqual(end, 2.1)
        self.assertAlmostEqual(lost, 0.6)
        # Both slots of a node fail; another node's does not.
        end, lost = makespan.play([1.0] * 2, [1.0], failures, options(nodes=1, threads=2), False)
        self.assertAlmostEqual(lost, 1.2)
        apart = np.array([[0.6, np.inf], [np.inf, np.inf]])
        self.assertAlmostEqual(makespan.play([1.0] * 2, [1.0, 1.0], apart, options(), False)[1], 0.6)

    def test_members_are_dealt_out_once(self):
        for how in ("modulo", "blocks"):
            counts = makespan.dealt(how, 7, 1000, 4)
            self.assertTrue(np.allclose(counts.sum(axis=0), 250), how)
            self.assertTrue(np.allclose(counts.sum(axis=1), 1000 / 7), how)
        # A part of each cell, or of neighbours only.
        self.assertTrue((makespan.dealt("modulo", 7, 1000, 4) > 0).all())
        self.assertTrue(((makespan.dealt("blocks", 7, 1000, 4) > 0).sum(axis=1) <= 2).all())

    def test_costs_are_read_by_cell(self):
        with tempfile.TemporaryDirectory() as home:
            table = Path(home) / "summary.csv"
            table.write_text("member,cell,solves\n0,0,10\n1,0,30\n2,1,20\n")
            (Path(home) / "run.json").write_text('{"spec": {"points": 10, "sweep": {"points": [10, 50]}}}')
            mean, variance = makespan.cells(table, 0.5, 2500.0)
        self.assertTrue(np.allclose(mean * 3.6e6, [1.0, 3.0]))
        self.assertTrue(np.allclose(np.sqrt(variance) * 3.6e6, [0.25, 0.0]))
        self.assertTrue(math.isclose(3.6e6 * mean.mean(), 2.0))

    def test_the_nodes_of_a_cell_are_those_of_the_sweep(self):
        spec = {"points": 100, "sweep": {"points": [50, 200], "amplitude": [0.01, 0.02, 0.04]}}
        self.assertEqual([makespan.points(spec, cell) for cell in range(6)], [50, 50, 50, 200, 200, 200])
        spec["sweep"] = {"amplitude": [0.01, 0.02], "points": [50, 200]}
        self.assertEqual([makespan.points(spec, cell) for cell in range(4)], [50, 200, 50, 200])
        self.assertEqual([makespan.points({"points": 100}, 0), makespan.points({"points": 100, "sweep": {}}, 3)], [100, 100])


if __name__ == "__main__":
    unittest.main()
