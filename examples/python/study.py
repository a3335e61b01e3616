"""From a run to a figure: how the relaxation time of a perturbed circle depends on the size of the perturbation.

Under surface diffusion the slowest mode of a circle of radius R has m = 2 and decays at the rate m²(m² - 1)/R⁴ = 12/R⁴.
The excess is quadratic in the amplitude σ, so the time at which it falls to a fixed value grows as ln σ / 12: that is the
slope which the fit should find.

    python examples/python/study.py --out study

runs curvelax for six amplitudes, reads its tables with pandas and the nodes of one member with xarray, prints the fit and
leaves the run in study/run and the figure as study/study.png. Times are in units of length⁴; the radius is 1.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")  # writes files, needs no display

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr

AMPLITUDES = [0.0025, 0.005, 0.01, 0.02, 0.04, 0.08]
TIMES = [0, 0.0003, 0.001, 0.003, 0.01, 0.03, 0.1]
RATE = 12.0  # of mode 2 on the unit circle


def program(given):
    """The path of curvelax: the one given, the one on PATH, or cargo's."""
    built = Path(__file__).parents[2] / "target" / "release" / "curvelax"
    found = given or shutil.which("curvelax") or (built if built.exists() else None)
    if found is None:
        sys.exit("no curvelax: build it with `cargo build --release`, or name it with --curvelax PATH")
    return found


def run(curvelax, out, curves):
    """One run with a cell for each amplitude."""
    flags = {
        "shape": "circle:1",
        "curves": curves,
        "sweep": "amplitude=" + ",".join(map(str, AMPLITUDES)),
        "adaptive": 1e-4,
        "relax-at": 1e-8,
        "t-end": 0.8,
        "pull": "auto",
        "snapshots": ",".join(map(str, TIMES)),
        "store": "zarr",
        "out": out,
    }
    arguments = [word for key, value in flags.items() for word in (f"--{key}", str(value))]
    # The same perturbations, scaled: cells differ by σ alone, and not by the luck of the draw.
    arguments += ["--common-random-numbers", "--force", "--quiet"]
    done = subprocess.run([curvelax, "run", *arguments])
    if done.returncode != 0:
        sys.exit(f"curvelax ended with exit code {done.returncode}")


def members(out):
    """summary.csv with the amplitude of each member's cell."""
    # Only what is empty is missing: a label may be "NA".
    empty = {"keep_default_na": False, "na_values": [""]}
    table = pd.read_csv(out / "summary.csv", index_col="member", **empty)
    cells = pd.read_csv(out / "ensemble.csv", index_col="cell", **empty)
    return table.join(cells["amplitude"], on="cell")


def survival(table):
    """Kaplan-Meier: times, and the share not relaxed after each. A member without t_relax counts until its t_end."""
    relaxed = table.t_relax.notna()
    at = table.t_relax.where(relaxed, table.t_end)
    counts = pd.DataFrame({"relaxed": relaxed, "all": True}).groupby(at).sum()
    at_risk = counts["all"][::-1].cumsum()[::-1]
    share = (1 - counts.relaxed / at_risk).cumprod()
    return np.concatenate([[0], share.index]), np.concatenate([[1], share])


def fit(table):
    """Least squares of the cells' median t_relax = a + b ln σ: a, b, and the standard error of b."""
    medians = table.groupby("amplitude").t_relax.median()
    (b, a), covariance = np.polyfit(np.log(medians.index), medians, 1, cov=True)
    return a, b, np.sqrt(covariance[0, 0])


def draw(table, snapshots, path):
    """Survival by amplitude, t_relax against amplitude with the fit, and one member over time."""
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12, 4), layout="constrained")
    amplitudes = sorted(table.amplitude.unique())
    colours = dict(zip(amplitudes, plt.get_cmap("viridis")(np.linspace(0, 0.9, len(amplitudes)))))

    for amplitude, cell in table.groupby("amplitude"):
        left.step(*survival(cell), where="post", color=colours[amplitude], label=f"{amplitude:g}")
    left.set(xlabel="time / R⁴", ylabel="share not relaxed", ylim=(0, 1.02), title="Survival")
    left.set_xlim(0, 1.05 * table.t_relax.max())
    left.legend(title="σ", frameon=False, loc="lower left")

    a, b, error = fit(table)
    spread = np.random.default_rng(1).uniform(-0.12, 0.12, len(table))
    middle.scatter(table.amplitude * np.exp(spread), table.t_relax, s=4, alpha=0.35, lw=0,
                   c=[colours[amplitude] for amplitude in table.amplitude])
    quartiles = table.groupby("amplitude").t_relax.quantile([0.25, 0.5, 0.75]).unstack()
    median = quartiles[0.5]
    bars = [median - quartiles[0.25], quartiles[0.75] - median]
    middle.errorbar(median.index, median, bars, fmt="o", ms=5, color="black", capsize=3, label="median, quartiles")
    line = np.array([amplitudes[0] / 1.3, amplitudes[-1] * 1.3])
    middle.plot(line, a + b * np.log(line), color="crimson", label=f"fit: slope {b:.4f}, standard error {error:.4f}")
    theory = median.iloc[0] + np.log(line / amplitudes[0]) / RATE
    middle.plot(line, theory, "k:", label=f"theory: slope 1/12 = {1 / RATE:.4f}")
    middle.set(xscale="log", xlabel="amplitude σ", ylabel="t_relax / R⁴", title="Relaxation time grows as ln σ / 12")
    middle.set_xticks(amplitudes, [f"{amplitude:g}" for amplitude in amplitudes])
    middle.minorticks_off()
    middle.legend(frameon=False, loc="upper left")

    # The roughest member; only its nodes are read from disk.
    rough = table.excess_start.idxmax()
    curves = snapshots[["x", "y"]].sel(member=rough).load()
    shades = plt.get_cmap("plasma")(np.linspace(0, 0.85, curves.sizes["time"]))
    for colour, (_, curve) in zip(shades, curves.groupby("time")):
        closed = curve.squeeze().isel(node=np.arange(curve.sizes["node"] + 1) % curve.sizes["node"])
        right.plot(closed.x, closed.y, color=colour, lw=1.3, label=f"{float(curve.time.squeeze()):g}")
    title = f"Member {rough}, σ = {table.amplitude[rough]:g}, at times t / R⁴"
    right.set(aspect="equal", xlabel="x / R", ylabel="y / R", title=title)
    right.legend(frameon=False, loc="center", fontsize=8)
    figure.savefig(path, dpi=150)
    plt.close(figure)
    return b, error


def main():
    parser = argparse.ArgumentParser(description="How relaxation times depend on the size of the perturbation")
    parser.add_argument("--curvelax", metavar="PATH", help="the program [default: on PATH, or built by cargo]")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("study"), help="folder [default: study]")
    parser.add_argument("--curves", metavar="COUNT", type=int, default=128, help="members of a cell [default: 128]")
    arguments = parser.parse_args()

    # A folder of its own: --force replaces a run, and refuses a folder that holds anything else.
    out = arguments.out / "run"
    run(program(arguments.curvelax), out, arguments.curves)
    table = members(out)
    print(table.groupby("amplitude").t_relax.describe()[["count", "mean", "std", "50%"]])
    snapshots = xr.open_zarr(out / "snapshots.zarr", chunks=None)
    picture = arguments.out / "study.png"
    slope, error = draw(table, snapshots, picture)
    print(f"slope of median t_relax against ln σ: {slope:.4f} (standard error {error:.4f}), theory 1/12 = {1 / RATE:.4f}")
    print(f"figure: {picture}")


if __name__ == "__main__":
    main()
