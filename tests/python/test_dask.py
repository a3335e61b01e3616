"""examples/python/dask_study.py: a worker is killed on the way, and the files are those of the single run."""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import psutil

from common import CURVELAX, rows

STUDY = Path(__file__).parents[2] / "examples" / "python" / "dask_study.py"
SHARDS = 4
MEMBERS = 1600
# What is waited for so long hangs: nothing here depends on how fast a machine is.
HANGS = 6 * 3600
# A failed task is tried again so often.
RETRIES = 3
# Two cells.
SPEC = f"""
curves = {MEMBERS // 2}
stop-when-relaxed = true
backend = "cpu"

[sweep]
adaptive = [1e-3, 1e-5]
"""


# What the study starts in the place of curvelax: notes each start, and while there is a file `hold`, a shard waits to be
# woken.
WRAPPER = """#!/bin/sh
echo "$*" >>"$0.log"
case "$* " in
*" --shard "*) [ ! -e "$0.hold" ] || kill -STOP $$ ;;
esac
exec "$CURVELAX_ITSELF" "$@"
"""


def files(folder):
    """The bytes of all files but run.json, which has times."""
    paths = [path for path in folder.rglob("*") if path.is_file() and path.name != "run.json"]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def shards(study):
    """The processes of the study that run a shard, with the folder of each."""
    found = []
    for process in psutil.Process(study.pid).children(recursive=True):
        try:
            line = process.cmdline()
            if "--shard" in line:
                found.append((process, Path(line[line.index("--out") + 1])))
        except psutil.NoSuchProcess:
            pass  # ended in the meantime
    return found


def held(study):
    """Those of them that wait to be woken."""

    def is_held(process):
        try:
            return process.status() == psutil.STATUS_STOPPED
        except psutil.NoSuchProcess:
            return False

    return [(process, out) for process, out in shards(study) if is_held(process)]


def wake(study, but=None):
    """Wakes those that still wait, all but one."""
    for process, _ in held(study):
        if process != but:
            process.resume()


def pending(process):
    """The signals that a process has not yet got, a bit each."""
    return int(re.search(r"ShdPnd:\s*(\w+)", Path(f"/proc/{process.pid}/status").read_text())[1], 16)


def end(process):
    """Ends a process that a test has stopped, however the test went."""
    try:
        process.kill()
    except psutil.NoSuchProcess:
        pass


class Over(AssertionError):
    """The study ended before what was waited for came."""


def soon(look, study, meanwhile=lambda: None):
    """The first result of `look` that is something, while the study runs."""
    until = time.monotonic() + HANGS
    while time.monotonic() < until:
        if study.poll() is not None:
            raise Over(f"the study ended with {study.returncode}")
        meanwhile()
        if found := look():
            return found
        time.sleep(0.01)
    raise AssertionError("what was waited for did not come")


def is_over(process):
    """Whether it has ended, even if its result was not fetched yet."""
    return not process.is_running() or process.status() == psutil.STATUS_ZOMBIE


def caught(study):
    """A shard that is suspended in its middle, with its worker and its folder; else nothing."""
    for curvelax, out in held(study):
        table = out / ".summary.csv.part"
        try:
            worker = curvelax.parent()
            curvelax.resume()
            # Looked at as often as possible, as it may need a few milliseconds only.
            while not (is_over(curvelax) or (table.exists() and table.stat().st_size > 0)):
                time.sleep(0.0005)
            curvelax.suspend()
            soon(lambda: is_over(curvelax) or curvelax.status() == psutil.STATUS_STOPPED, study)
            # Once it is suspended, its table shows whether it is at work.
            if table.exists() and not is_over(curvelax):
                return curvelax, worker, out
            curvelax.resume()
        except (psutil.NoSuchProcess, FileNotFoundError):
            pass  # ended too soon
    return None


@unittest.skipUnless(sys.platform == "linux", "kills processes as Linux has them")
class Dask(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        home = tempfile.TemporaryDirectory()
        cls.addClassCleanup(home.cleanup)
        cls.home = Path(home.name)
        (cls.home / "spec.toml").write_text(SPEC)
        subprocess.run([CURVELAX, "run", cls.home / "spec.toml", "--quiet", "--out", cls.home / "single"], check=True)
        cls.single = files(cls.home / "single")

    def study(self, name, kill, deaths="3"):
        """Runs the study in two workers, of which `kill` kills one; its exit code, what it printed, and its folder."""
        until = time.monotonic() + HANGS
        while (done := self.attempt(name, kill, deaths)) is None:
            self.assertLess(time.monotonic(), until, "no shard is ever caught at work")
            # The same again.
            for left in self.home.glob(f"{name}*"):
                shutil.rmtree(left) if left.is_dir() else left.unlink()
        return done

    def attempt(self, name, kill, deaths):
        """The same, or None if all shards were over before one was caught at work."""
        out = self.home / name
        command = [sys.executable, STUDY, self.home / "spec.toml", "--shards", SHARDS, "--workers", 2, "--out", out]
        wrapper = self.home / f"{name}.sh"
        wrapper.write_text(WRAPPER)
        wrapper.chmod(0o755)
        if kill:
            Path(f"{wrapper}.hold").touch()
        environment = {
            **os.environ,
            "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": deaths,
            "CURVELAX": str(wrapper),
            "CURVELAX_ITSELF": CURVELAX,
        }
        with open(self.home / f"{name}.log", "w+") as log:
            study = subprocess.Popen(list(map(str, command)), stdout=log, stderr=log, env=environment)
            try:
                if kill:
                    try:
                        shard = soon(lambda: caught(study), study)
                    except Over:
                        self.assertEqual(study.returncode, 0, Path(log.name).read_text())
                        return None
                    self.kill(study, kill, wrapper, *shard)
                until = time.monotonic() + HANGS
                while (code := study.poll()) is None:
                    self.assertLess(time.monotonic(), until, "the study hangs")
                    wake(study)
                    time.sleep(0.01)
            finally:
                study.kill()
            log.seek(0)
            return code, log.read(), out

    def kill(self, study, who, wrapper, curvelax, worker, out):
        """Kills a worker in the middle of its shard: with its curvelax, or without."""
        self.addCleanup(end, curvelax)
        worker.kill()
        if who == "both":
            curvelax.kill()
        Path(f"{wrapper}.hold").unlink()
        if who == "both":
            return

        def wake_others():
            wake(study, but=curvelax)

        # Its worker gone, it is told to end, but holds the lock of its folder until the retry was refused more often than it
        # may fail. All other shards are done by then, so that nothing else keeps the workers.
        soon(lambda: pending(curvelax) >> signal.SIGTERM - 1 & 1, study, wake_others)
        soon(lambda: len(list(out.parent.glob("*/run.json"))) == SHARDS - 1, study, wake_others)
        log = Path(f"{wrapper}.log")
        soon(lambda: log.read_text().count(f"--out {out}\n") > 2 + RETRIES, study, wake_others)
        self.assertIsNone(study.poll(), "the study did not wait")
        curvelax.resume()

    def assert_whole(self, out):
        """Each member once, and every byte that of the single run."""
        self.assertEqual([int(row["member"]) for row in rows(out / "summary.csv")], list(range(MEMBERS)))
        found = files(out)
        self.assertEqual(sorted(found), sorted(self.single))
        for name, content in self.single.items():
            self.assertTrue(found[name] == content, name)

    def test_a_worker_is_killed_with_its_shard(self):
        code, said, out = self.study("both", "both")
        self.assertEqual(code, 0, said)
        self.assert_whole(out)
        # Both cells are printed with all their members.
        self.assertRegex(said, rf"(?m)^0 +{MEMBERS // 2} ")
        self.assertRegex(said, rf"(?m)^1 +{MEMBERS // 2} ")

    def test_a_worker_is_killed_and_its_shard_is_left_behind(self):
        code, said, out = self.study("worker", "worker")
        self.assertEqual(code, 0, said)
        self.assert_whole(out)

    def test_a_death_that_is_not_allowed_ends_the_study_and_the_same_line_ends_it_well(self):
        """The control: the kill is felt. Nothing is merged of three shards in four, and nothing is lost of them."""
        code, said, out = self.study("control", "both", deaths="0")
        self.assertNotEqual(code, 0)
        self.assertIn("KilledWorker", said)
        self.assertFalse(out.exists())
        self.assertEqual(self.study("control", None)[0], 0)
        self.assert_whole(out)

    def test_the_comparison_sees_a_byte_and_a_member(self):
        out = self.home / "changed"
        shutil.copytree(self.home / "single", out)
        self.assert_whole(out)
        table = (out / "summary.csv").read_text().splitlines(keepends=True)
        changed = table[7].replace("relaxed", "singular")
        for rows_now in ([*table[:7], changed, *table[8:]], table[:-1], [*table, table[-1]]):
            (out / "summary.csv").write_text("".join(rows_now))
            self.assertRaises(AssertionError, self.assert_whole, out)
        shutil.copy(self.home / "single" / "summary.csv", out)
        (out / "plots" / "mesh.svg").unlink()
        self.assertRaises(AssertionError, self.assert_whole, out)


if __name__ == "__main__":
    unittest.main()
