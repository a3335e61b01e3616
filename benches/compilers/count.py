"""Counts what a kernel issues on an NVIDIA GPU, by running its machine code.

    count.py LISTING METAL N REGISTERS

LISTING is what nvdisasm -c prints, METAL the kernel it was compiled from, which has the layout of the buffers. sass.py
runs it for one member, a perturbed circle of N nodes. The nodes of direct steps are compared with
benches/peers/scheme.py.

Prints rows of Markdown: what was counted; instructions, over all warps of the workgroup; barriers; the cycles of the
workgroup alone; the registers of a thread and the workgroups that they leave on a multiprocessor; and how many a second
the device does at most, by its busiest pipe or the instructions, and by latency with so many workgroups on every
multiprocessor. The device is an H100: 132 multiprocessors with four schedulers each, at 1.7 GHz.
"""

import re
import sys
from collections import Counter
from math import pi, tan
from pathlib import Path

import numpy as np
import sass

sys.path.append(str(Path(__file__).resolve().parent.parent / "peers"))
import scheme  # noqa: E402

MULTIPROCESSORS, HERTZ = 132, 1.7e9
REGISTERS_OF_A_SCHEDULER = 16384
FIXED_STEP, OMEGA = 1e-3, 10.0
# The parts of the rows of an adaptive step of the largest order in f32, as in crates/flow/src/scheme/extrapolation.rs;
# the attempts have it.
DIVISIONS = [1, 2, 3, 5, 8, 12]
MOST_ORDER = len(DIVISIONS)
AGREES = 1e-4
# The bits of the place at 0, and steps in a unit, as in shaders/place_fixed.wgsl.
ORIGIN, PER_UNIT = 0x40000000, 2.0**27
NEVER = 2**32 - 1


def fields(metal, name, prefix=""):
    """The names of the numbers in a struct, in order."""
    body = re.search(rf"^struct {name} \{{(.*?)^\}};", metal, re.M | re.S)[1]
    for kind, field, count in re.findall(r"(\w+) (\w+)(?:\[(\d+)\])?;", body):
        if kind in ("uint", "real", "float"):
            for index in range(int(count or 1)):
                yield prefix + field + (f".{index}" if count else "")
        else:
            yield from fields(metal, kind, f"{prefix}{field}.")


def circle(n):
    """A perturbed circle: x, y, and k and r of its edges."""
    t = 2 * pi * np.arange(n) / n
    radius = 1 + 0.1 * np.cos(2 * t) + 0.03 * np.sin(3 * t)
    x, y = radius * np.cos(t), radius * np.sin(t)
    ex, ey = x - np.roll(x, 1), y - np.roll(y, 1)
    fx, fy = np.roll(ex, -1), np.roll(ey, -1)
    r = np.hypot(ex, ey)
    angle = np.arctan2(ex * fy - ey * fx, ex * fx + ey * fy)
    k = (np.roll(angle, 1) + angle) / (r + np.roll(r, 1) / 2 + np.roll(r, -1) / 2)
    return x, y, k, r


def solve_dense(rows, sides):
    """The periodic pentadiagonal solver that scheme.py asks for."""
    at = np.arange(len(rows[0]))
    matrix = np.zeros((len(at), len(at)))
    for offset, row in zip(range(-2, 3), rows):
        matrix[at, (at + offset) % len(at)] += row
    return [np.linalg.solve(matrix, side) for side in sides]


class Kernel:
    """A compiled kernel, and what one dispatch of it costs."""

    def __init__(self, listing, metal, n):
        self.text, self.metal, self.n = Path(listing).read_text(), Path(metal).read_text(), n
        self.blocks = (n + 3) // 4
        assert n % 4 == 0, "blocks of three are not laid out here"
        self.start = circle(n)

    def lengths_by_refinements(self):
        """Lengths of adaptive steps that are refined 0, 1, 2 and 3 times, by shaders/pace.wgsl."""
        longest = (scheme.observe(np, self.start)[0] / self.n) ** 4 / (16 * np.finfo(np.float32).eps)
        return [share * longest for share in (3e-6, 1e-4, 3e-3, 3e-2)]

    def run(self, dispatch, counters=(), parameters=(), first=0.0):
        """Runs a dispatch, whose first adaptive step has the length `first`; returns what it cost, the curve, and the
        counters."""
        length, area, excess, energy, k_min, k_max, _, _, drift = scheme.observe(np, self.start)
        epsilon = np.finfo(np.float32).eps
        unit = 2.0 ** np.ceil(np.log2(4 * epsilon))
        p = dict.fromkeys(fields(self.metal, "Parameters"), 0.0)
        p |= dict(tau=FIXED_STEP, omega=OMEGA, redistribution=1, tolerance=1e-5, adaptive=1e-3 / 12)
        p |= dict(polygon_ratio=self.n / pi * tan(pi / self.n), relax_at=-1, half_at=excess / 2, fit_from=excess / 10)
        p |= dict(fit_to=excess / 1000, follow_to=excess / 1000, least_length=length / 1000, look_at=1e18)
        p |= dict(time_unit=unit, time_tick=unit * epsilon, clock_end=2000, end_high=2, goal_high=2)
        p |= {"law.inner.22": 4 * pi, "r_offset": np.float32(self.start[3].mean())} | dict(parameters)
        c = dict.fromkeys(fields(self.metal, "Counters"), 0)
        c |= dict(order=MOST_ORDER, goal=2**31, relax_step=NEVER, half_step=NEVER) | dict(counters)
        report = dict.fromkeys(fields(self.metal, "Record"), 0.0)
        for when in ("before", "now"):
            known = dict(length=length, area=area, excess=excess, energy=energy, k_min=k_min, k_max=k_max)
            report |= {f"report.{when}.{name}": value for name, value in known.items()}
        report |= {"report.progress.turning": 1.0, "report.progress.next": first}
        d = dict.fromkeys(fields(self.metal, "Dispatch"), 0)
        d |= dict(max_sweeps=2**31, sweeps=2**31, blocks=self.blocks, groups=int(np.ceil(np.sqrt(self.blocks))))
        d |= {"most_order": MOST_ORDER} if "most_order" in d else {}
        d |= dict(dispatch)
        states = np.zeros((int(re.search(r"STATE_FIELDS = (\d+)u", self.metal)[1]), self.n), np.float32)
        places = np.rint(np.array(self.start[:2]) * PER_UNIT) + ORIGIN
        states[:2] = places.astype(np.uint32).view(np.float32)
        states[2], states[3] = self.start[2], self.start[3] - p["r_offset"]

        integers = lambda of: np.array(list(of.values()), np.uint32)
        reals = lambda of: np.array(list(of.values()), np.float32)
        contents = [integers(d), reals(p), integers(c), reals(report), states, np.zeros(16, np.uint32)]
        contents.append(np.zeros(16, np.uint32))
        words = [np.ascontiguousarray(content).view(np.uint32).ravel() for content in contents]
        # Buffer b is at address (b + 1) << 32.
        buffers = {b + 1: np.concatenate([content, np.zeros(16, np.uint32)]) for b, content in enumerate(words)}
        constants = {0x20: 0, 0x24: sass.LOCAL, 0x28: 4096, 0x208: 0, 0x20C: 0}
        for b in range(len(contents)):
            constants |= {sass.CONSTANT_BASE + 8 * b: 0, sass.CONSTANT_BASE + 8 * b + 4: b + 1}
        machine = sass.Machine(sass.Listing(self.text), constants, buffers, -(-self.blocks // sass.LANES) * sass.LANES)
        machine.run()
        x, y, k, r = buffers[5][: len(words[4])].view(np.float32).reshape(states.shape)[:4]
        nodes = ((place.view(np.uint32).astype(float) - ORIGIN) / PER_UNIT for place in (x, y))
        curve = *nodes, k, r.astype(float) + p["r_offset"]
        ended = dict(zip(c, buffers[3].tolist()))
        assert ended["status"] in (0, 5), f"the member ended: {ended}"
        return machine.cost(), curve, ended


def difference(more, less, times):
    """The cost of one of `times` things by which two dispatches differ."""
    cost = Counter(more)
    cost.subtract(less)
    return Counter({name: value / times for name, value in cost.items()})


def direct(kernel):
    """A fixed step by the direct solver."""
    (less, curve, _), (more, _, _) = (kernel.run({"steps": steps}) for steps in (2, 6))
    expected = kernel.start
    for _ in range(2):
        expected = scheme.step(np, solve_dense, expected, FIXED_STEP, OMEGA, (0, 0))
    error = max(abs(got - good).max() for got, good in zip(curve, expected))
    assert error < AGREES, f"the kernel's curve is {error} away from the reference"
    yield "fixed step", difference(more, less, 4)


def adaptive(kernel):
    """An attempt of an adaptive step of the highest order, by how often its solutions are refined; one with the fit of
    the decay."""
    parts = sum(DIVISIONS)
    refined = [f", {often}" for often in ("not refined", "refined once", "refined twice", "refined three times")]
    rows = [(what, length, {}) for what, length in zip(refined, kernel.lengths_by_refinements())]
    rows.append((refined[0] + ", decay fitted", rows[0][1], {"fit_from": 1.0, "fit_to": 0.0}))
    for what, length, law in rows:
        costs = []
        for attempts in (0, 1):
            # Whatever the length, the step counts as accurate.
            p = {"clock_end": 2, "adaptive": 1.0} | law
            cost, _, ended = kernel.run({"steps": attempts * parts}, parameters=p, first=length)
            assert (ended["steps"], ended["solves"]) == (attempts, attempts * parts), ended
            costs.append(cost)
        yield f"attempt of order {MOST_ORDER}, {parts} parts{what}", difference(costs[1], costs[0], 1)


def sweeps(kernel):
    """Sweeps, an eighth of a check included; a step with 500 of each."""
    endless = {"tolerance": 0.0, "sor": 1.5}
    one = []
    for phase in (0, 1):
        runs = [kernel.run({"steps": 1, "max_sweeps": most}, {"phase": phase}, endless)[0] for most in (88, 24)]
        one.append(difference(*runs, 64))
    yield "sweep of k", one[0]
    yield "sweep of x and y", one[1]
    converged = [kernel.run({"steps": steps}, parameters={"tolerance": 0.01, "sor": 1.5}) for steps in (2, 1)]
    step = difference(converged[0][0], converged[1][0], 1)
    for which, count in zip(one, ("sweeps_k", "sweeps_x")):
        made = converged[0][2][count] - converged[1][2][count]
        for name in step:
            step[name] += (500 - made) * which[name]
    yield "fixed step of 500 sweeps a system", step


def row(name, cost, registers, warps):
    """One row of the table."""
    warps_that_fit = sass.SCHEDULERS * (REGISTERS_OF_A_SCHEDULER // (sass.LANES * (-(-registers // 8) * 8)))
    groups = min(warps_that_fit // warps, 32)
    busiest = max(cost["issued"], max(value for key, value in cost.items() if key.startswith("busy ")))
    by_issue = MULTIPROCESSORS * sass.SCHEDULERS * HERTZ / busiest
    by_latency = MULTIPROCESSORS * groups * HERTZ / cost["cycles"]
    numbers = [cost[of] for of in ("issued", "barriers", "cycles")]
    cells = [name] + [f"{number:.4g}" if number < 1000 else f"{number:.0f}" for number in numbers]
    cells += [registers, groups, f"{by_issue:.2g}", f"{by_latency:.2g}"]
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def main():
    listing, metal, n, registers = sys.argv[1:]
    kernel = Kernel(listing, metal, int(n))
    name = Path(metal).name.split("-f32")[0]
    kinds = {"direct": direct, "direct-adaptive": adaptive, "gauss-seidel": sweeps, "gauss-seidel-subgroup": sweeps}
    for what, cost in kinds[name](kernel):
        row(f"{name}, n = {n}: {what}", cost, int(registers), -(-kernel.blocks // sass.LANES))


if __name__ == "__main__":
    main()
