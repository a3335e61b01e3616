"""A study in shards on dask.distributed; its files are those of the single run, byte for byte but for run.json.

    python examples/python/dask_study.py examples/specs/amplitude.toml --shards 8 --workers 2 --out amplitude

The same line starts and resumes: what an earlier attempt left in amplitude.shards is not computed again. On a cluster
with a shared file system, use Client("tcp://SCHEDULER:8786") instead of the LocalCluster.
"""

import argparse
import ctypes
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
from dask.distributed import Client, LocalCluster


def run_shard(i, shards, run, home):
    """Runs shard i, from its start or from where an earlier try left it, and returns its folder."""
    out = f"{home}/{i}-of-{shards}"
    # A killed worker leaves its curvelax behind, which continues and keeps the folder locked. Linux ends it with the
    # worker. The retry waits until it has ended (elsewhere: until its shard is done) and resumes from its checkpoint.
    libc = ctypes.CDLL(None) if sys.platform == "linux" else None

    def end_with_worker():
        if libc:
            libc.prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG

    command = [*run, "--shard", f"{i}/{shards}", "--out", out]
    while True:
        done = subprocess.run(command, stderr=subprocess.PIPE, text=True, preexec_fn=end_with_worker)
        if done.returncode == 0:
            return out
        if "a run is writing here" not in done.stderr:
            raise RuntimeError(f"shard {i}/{shards}: exit code {done.returncode}: {done.stderr.strip()}")
        time.sleep(0.5)


def main():
    parser = argparse.ArgumentParser(description="A study in shards on dask.distributed")
    parser.add_argument("spec", metavar="SPEC.toml", nargs="?", default="examples/specs/amplitude.toml")
    parser.add_argument("--shards", metavar="N", type=int, default=8, help="[default: 8]")
    parser.add_argument("--workers", metavar="W", type=int, default=os.cpu_count(), help="[default: one a core]")
    parser.add_argument("--out", metavar="DIR", default="study", help="folder [default: study]")
    arguments = parser.parse_args()
    curvelax = os.environ.get("CURVELAX") or shutil.which("curvelax")
    if curvelax is None:
        sys.exit("no curvelax: put it on PATH, or its path into CURVELAX")
    out = os.path.abspath(arguments.out)

    run = [curvelax, "run", os.path.abspath(arguments.spec), "--threads", "1", "--resume", "--quiet"]
    # Each worker is a process with a nanny, which replaces it when it dies; its shard goes to another one, three times at
    # most (distributed.scheduler.allowed-failures). Retries are for shards that fail: a full disk, exit code 75.
    workers = {"n_workers": arguments.workers, "threads_per_worker": 1, "dashboard_address": ":0"}
    with LocalCluster(**workers) as cluster, Client(cluster) as client:
        same = {"shards": arguments.shards, "run": run, "home": f"{out}.shards"}
        folders = client.gather(client.map(run_shard, range(arguments.shards), **same, retries=3, pure=False))
    merged = subprocess.run([curvelax, "merge", *folders, "--force", "--quiet", "--out", out])
    if merged.returncode != 0:
        sys.exit(f"curvelax merge ended with exit code {merged.returncode}")

    table = pd.read_csv(Path(out) / "summary.csv", index_col="member", keep_default_na=False, na_values=[""])
    columns = {"members": ("status", "size"), "relaxed": ("t_relax", "count"), "median": ("t_relax", "median")}
    print(table.groupby("cell").agg(**columns))


if __name__ == "__main__":
    main()
