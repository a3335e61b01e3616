"""How long a study takes in N shards on nodes that differ and fail, simulated from the work of a small run.

    curvelax run --curves 300 --sweep points=50,100,200,400 --adaptive --solver direct --stop-when-relaxed --backend cpu --out pilot
    python examples/python/makespan.py pilot/summary.csv

A member costs --member-ms, and --node-ns for each of its nodes in each of its solves (`summary.csv`; the nodes of a cell
are in run.json beside it). A slot takes one shard after another, in their order, and
--start seconds to begin each. The slots of a node have one speed, fail together, and are back after --requeue seconds, as
are the shards that they had, at the end of the queue. What is lost then is the work since the last checkpoint, or all.
`modulo` deals members out as curvelax does, j mod N; `blocks` gives shard i the i-th part of them, in a row. Times are
medians over --rounds draws of speeds, failures and costs; efficiency is the share of what the slots could have done.
"""

import argparse
import csv
import heapq
import json
import math
from pathlib import Path

import numpy as np


def points(spec, cell):
    """The nodes of a cell; the last key of a sweep varies fastest."""
    for key, values in reversed(spec.get("sweep", {}).items()):
        cell, at = divmod(cell, len(values))
        if key == "points":
            return values[at]
    return spec["points"]


def cells(path, member_ms, node_ns):
    """Mean and variance of the hours that a member of each cell takes."""
    spec = json.loads(Path(path).with_name("run.json").read_text())["spec"]
    with open(path, newline="") as file:
        rows = [(int(row["cell"]), int(row["solves"])) for row in csv.DictReader(file)]
    cell, solves = np.array(rows).T
    nodes = np.array([points(spec, c) for c in range(cell.max() + 1)])
    hours = (member_ms / 1e3 + node_ns / 1e9 * solves * nodes[cell]) / 3600
    each = [hours[cell == c] for c in np.unique(cell)]
    return np.array([h.mean() for h in each]), np.array([h.var() for h in each])


def dealt(how, shards, members, cells):
    """How many members of each cell a shard has."""
    if how == "modulo":
        return np.full((shards, cells), members / cells / shards)
    ends = np.linspace(0, members, shards + 1)[:, None]
    borders = np.linspace(0, members, cells + 1)
    return np.diff(np.clip(ends, borders[:-1], borders[1:]), axis=0)


def play(work, speeds, failures, options, kept):
    """The hours until all shards are done, and the slot-hours of work that was done again."""
    slots = [(0.0, slot) for slot in range(options.nodes * options.threads)]
    waiting = [(0.0, shard, hours) for shard, hours in enumerate(work)]
    end = lost = 0.0
    while waiting:
        ready, shard, hours = heapq.heappop(waiting)
        free, slot = heapq.heappop(slots)
        node = slot // options.threads
        begin = max(ready, free)
        done = begin + options.start / 3600 + hours / speeds[node]
        fails = failures[node][np.searchsorted(failures[node], begin, side="right")]
        if done <= fails:
            end = max(end, done)
            heapq.heappush(slots, (done, slot))
            continue
        ran = max(0.0, fails - begin - options.start / 3600)
        state = ran - math.fmod(ran, options.checkpoint / 3600) if kept else 0.0
        lost += ran - state
        back = fails + options.requeue / 3600
        heapq.heappush(waiting, (back, shard, hours - state * speeds[node]))
        heapq.heappush(slots, (back, slot))
    return end, lost


def simulate(how, shards, kept, mean, variance, options):
    """Medians over the rounds: hours, share of what the slots could have done, slot-hours lost."""
    results = []
    counts = dealt(how, shards, options.members, len(mean))
    for number in range(options.rounds):
        # The same machines, with the same failures, whatever is compared.
        draw = np.random.default_rng([options.seed, number])
        speeds = draw.uniform(1 - options.uneven, 1 + options.uneven, options.nodes)
        gaps = draw.exponential(options.hours_to_failure, (options.nodes, 1000))
        failures = np.hstack([np.cumsum(gaps, axis=1), np.full((options.nodes, 1), np.inf)])
        work = counts @ mean + np.sqrt(counts @ variance) * draw.standard_normal(shards)
        hours, lost = play(work, speeds, failures, options, kept)
        results.append((hours, work.sum() / (hours * speeds.sum() * options.threads), lost))
    return np.median(results, axis=0)


def span(hours):
    """A time as people read it."""
    for unit, size in ("h", 1), ("min", 1 / 60):
        if hours >= size:
            return f"{hours / size:.2f} {unit}"
    return f"{3600 * hours:.2f} s"


def main():
    parser = argparse.ArgumentParser(description="How long a study takes in N shards")
    parser.add_argument("summary", metavar="SUMMARY.csv")
    numbers = {
        "members": 1e9, "nodes": 8, "threads": 16, "uneven": 0.2, "hours-to-failure": 6.0, "requeue": 300.0,
        "checkpoint": 5.0, "start": 10.0, "member-ms": 0.15, "node-ns": 21.0, "rounds": 15, "seed": 1,
    }
    for name, value in numbers.items():
        parser.add_argument(f"--{name}", type=type(value), default=value, help=f"[default: {value:g}]")
    parser.add_argument("--shards", type=int, nargs="+", default=[128, 250, 500, 1000, 2000, 4000, 8000])
    options = parser.parse_args()

    mean, variance = cells(options.summary, options.member_ms, options.node_ns)
    whole = options.members * mean.mean()
    print(f"{options.members:g} members in {len(mean)} cells of {', '.join(f'{3.6e6 * h:.2g}' for h in mean)} ms a member:")
    print(f"{span(whole)} of one slot, {span(whole / options.nodes / options.threads)} of all.\n")
    each = "modulo | efficiency | lost | without checkpoints | efficiency | lost | blocks | efficiency"
    print(f"| shards | one shard | {each} |")
    print("|---" * 10 + "|")
    shortest = {}
    for shards in options.shards:
        line = [f"{shards}", span(whole / shards)]
        for how, kept in ("modulo", True), ("modulo", False), ("blocks", True):
            hours, efficiency, lost = simulate(how, shards, kept, mean, variance, options)
            line += [span(hours), f"{efficiency:.0%}", span(lost)][: 3 if how == "modulo" else 2]
            shortest.setdefault(shards, hours)
        print(f"| {' | '.join(line)} |")
    enough = next(shards for shards in sorted(shortest) if shortest[shards] <= 1.02 * min(shortest.values()))
    print(f"\nTake {enough} shards: the fewest that are within 2 % of the shortest time.")


if __name__ == "__main__":
    main()
