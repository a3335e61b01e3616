"""Runs curvelax and its peers side by side on the same curves: results first, then curve-steps per second.

A peer runs in one process a core, each on its own share of the curves and with one thread; the processes stay, and
in each round every peer and curvelax gets its turn.
"""

import argparse
import csv
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from peers import PEERS

POINTS, TAU, STEPS = 100, 1e-3, 100
# Largest distance between the nodes of two programs, relative to a curve of size 1: rounding, amplified.
BOUND = 1e-9
LAWS = {"surface-diffusion": (0.0, 0.0), "willmore": (0.0, -0.5), "elastic:0.5": (0.5, -0.5)}
TIMED = "surface-diffusion"
# Error of a relaxation time whose cost is compared.
TARGET = 1e-4
ONE_THREAD = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "NPROC": "1",  # what XLA sizes its pool by
}


def curvelax_states(program, curves, law):
    """(x, y, k, r) before and after the steps, node on the first axis and curve on the second, from curvelax."""
    end = STEPS * TAU
    with tempfile.TemporaryDirectory() as home:
        out = Path(home) / "out"
        command = f"run --curves {curves} --points {POINTS} --flow {law} --tau {TAU} --t-end {end} --snapshots 0,{end}"
        command += f" --solver direct --backend cpu --precision f64 --quiet --out {out}"
        subprocess.run([program, *command.split()], check=True)
        table = np.loadtxt(out / "snapshots.csv", delimiter=",", skiprows=1)
    fields = table.reshape(curves, 2, POINTS, 7)[:, :, :, 3:]
    return [[np.ascontiguousarray(fields[:, at, :, f].T) for f in range(4)] for at in (0, 1)]


def distance(ours, theirs):
    return max(np.abs(a - b).max() for a, b in zip(ours[:2], theirs[:2]))


def check(name, ours, theirs):
    """Refuses a peer that computes something else, and a comparison that would not notice."""
    moved = [u.copy() for u in theirs]
    moved[0][POINTS // 3, -1] += 10 * BOUND
    if distance(ours, moved) <= BOUND:
        sys.exit(f"FAILED: the comparison with {name} does not see a node that is off by {10 * BOUND:g}")
    error = distance(ours, theirs)
    if not error <= BOUND:
        sys.exit(f"FAILED: {name} ends {error:.1e} away from curvelax; the bound is {BOUND:g}")
    return error


def work(pipe, name, state):
    """A worker: one peer on its share of the curves. Sends its last states, then rates on request."""
    try:
        start = time.perf_counter()
        peer = {law: PEERS[name](state, STEPS, TAU, 1.0, LAWS[law]) for law in LAWS}
        pipe.send({law: peer[law].run() for law in LAWS})
        pipe.send(time.perf_counter() - start)
        while (seconds := pipe.recv()) is not None:
            made, start = 0, time.perf_counter()
            while time.perf_counter() - start < seconds:
                peer[TIMED].run()
                made += peer[TIMED].curves * STEPS
            pipe.send(made / (time.perf_counter() - start))
    except Exception as error:
        pipe.send(error)


class Workers:
    """A peer on several cores."""

    def __init__(self, name, states, processes):
        self.name, self.pipes = name, []
        context = multiprocessing.get_context("spawn")
        for state in np.array_split(np.arange(states[0].shape[1]), processes):
            ours, theirs = context.Pipe()
            share = [np.ascontiguousarray(u[:, state]) for u in states]
            context.Process(target=work, args=(theirs, name, share), daemon=True).start()
            self.pipes.append(ours)

    def receive(self):
        answers = [pipe.recv() for pipe in self.pipes]
        for answer in answers:
            if isinstance(answer, Exception):
                raise answer
        return answers

    def send(self, what):
        for pipe in self.pipes:
            pipe.send(what)

    def rate(self, seconds):
        self.send(seconds)
        return sum(self.receive())


def curvelax_rate(program, seconds, cores):
    command = f"bench --backend cpu --solver direct --precision f64 --points {POINTS} --seconds {seconds} --repeats 1"
    command += f" --threads {cores} --json --quiet"
    done = subprocess.run([program, *command.split()], check=True, capture_output=True)
    return json.loads(done.stdout)["rows"][0]["steps_per_second"]["median"]


def costs(program, cores):
    """Solves of fixed steps, and solves and seconds of the cheapest adaptive ones, for an error of TARGET in t_relax."""
    with tempfile.TemporaryDirectory() as home:
        out = Path(home) / "out"
        command = f"convergence --work-precision --backend cpu --solver direct --precision f64 --quiet --out {out}"
        # It takes as many threads as there are processors.
        subprocess.run(["taskset", "-c", f"0-{cores - 1}", program, *command.split()], check=True)
        rows = list(csv.DictReader((out / "work_precision.csv").open()))
    rows = [{key: float(value) for key, value in row.items() if key != "solver" and value} for row in rows]
    fixed = sorted((row["error"], row["solves"]) for row in rows if "tau" in row)
    errors, solves = np.log([*zip(*fixed)])
    if not errors[0] <= np.log(TARGET) <= errors[-1]:
        sys.exit(f"FAILED: no fixed steps are on both sides of an error of {TARGET:g}")
    best = min((row["seconds"], row["solves"]) for row in rows if "tolerance" in row and row["error"] <= TARGET)
    return float(np.exp(np.interp(np.log(TARGET), errors, solves))), best[1], best[0]


def cost_table(rates, costs):
    fixed, adaptive, seconds = costs
    each = {name: (fixed, fixed / statistics.median(all)) for name, all in rates.items()}
    each = {"curvelax, adaptive": (adaptive, seconds)} | {f"{name}, fixed": cost for name, cost in each.items()}
    lines = [f"{f'error {TARGET:g}':<20}{'solves':>10}{'ms a member':>14}{'adaptive is':>16}"]
    for name, (solves, time) in each.items():
        faster = f"{f'{time / seconds:.3g} x faster':>16}" if time != seconds else ""
        lines.append(f"{name:<20}{solves:>10.0f}{1e3 * time:>14.3g}{faster}")
    return "\n".join(lines)


def table(rates, errors):
    ours = rates["curvelax"]
    lines = [f"{'':<16}{'curve-steps/s':>15}{'min..max':>22}{'us/curve-step':>15}{'curvelax is':>14}{'differs by':>13}"]
    for name, all in rates.items():
        median = statistics.median(all)
        ratio = statistics.median(a / b for a, b in zip(ours, all))
        cells = f"{median:>15.3g}{f'{min(all):.3g}..{max(all):.3g}':>22}{1e6 / median:>15.3g}"
        faster = f"{f'{ratio:.3g} x faster':>14}{errors[name]:>13.1e}" if name in errors else ""
        lines.append(f"{name:<16}{cells}{faster}")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--curvelax", default="curvelax", help="the program [default: curvelax]")
    parser.add_argument("--cores", type=int, default=os.cpu_count(), help="processes of a peer, threads of curvelax")
    parser.add_argument("--repeats", type=int, default=7, help="rounds [default: 7]")
    parser.add_argument("--seconds", type=float, default=1.0, help="of each program in a round [default: 1]")
    args = parser.parse_args()
    if args.cores < 1 or args.repeats < 1 or not args.seconds > 0:
        parser.error("--cores, --repeats and --seconds: take more than 0")
    os.environ.update(ONE_THREAD)

    workers, errors = [], {}
    for name, peer in PEERS.items():
        if problem := peer.problem():
            print(f"{name} skipped: {problem}", file=sys.stderr)
            continue
        processes = args.cores if peer.on_cpu else 1
        curves = processes * peer.curves
        before, after = {}, {}
        for law in LAWS:
            before[law], after[law] = curvelax_states(args.curvelax, curves, law)
        group = Workers(name, before[TIMED], processes)
        ends, start_up = group.receive(), max(group.receive())
        for law in LAWS:
            shares = [np.concatenate(field, 1) for field in zip(*(end[law] for end in ends))]
            error = check(f"{name}, {law}", after[law], shares)
            errors[name] = max(error, errors.get(name, 0.0))
        print(f"{name}: {len(LAWS)} laws agree to {errors[name]:.1e}; start-up {start_up:.1f} s", file=sys.stderr)
        workers.append(group)

    rates = {"curvelax": []} | {group.name: [] for group in workers}
    for repeat in range(args.repeats):
        print(f"round {repeat + 1} of {args.repeats}", file=sys.stderr)
        rates["curvelax"].append(curvelax_rate(args.curvelax, args.seconds, args.cores))
        for group in workers:
            rates[group.name].append(group.rate(args.seconds))
    for group in workers:
        group.send(None)
    print(f"n = {POINTS}, tau = {TAU}, direct solves, f64, cores: {args.cores}, medians of {args.repeats} rounds\n")
    print(table(rates, errors))
    print("\na relaxation time with this relative error of the steps; fixed steps cost the same solves everywhere\n")
    print(cost_table(rates, costs(args.curvelax, args.cores)))


if __name__ == "__main__":
    main()
