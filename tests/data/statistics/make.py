"""Reference numbers for tests/it/statistics.rs: writes the samples, *.csv, and what is known of them, reference.toml.

Survival curves, medians, quantiles, restricted means and log-rank tests are those of lifelines, quantiles and moments
of complete data those of numpy and scipy, fits those of scipy. Two things lifelines does not give to 1e-12: the
deviation of the restricted time (it integrates numerically) and the standard error of the restricted mean. They are
computed here in rational numbers, and r.tsv, which make.R writes with R's survival package, has the latter again.
"""

import math
import warnings
from fractions import Fraction
from pathlib import Path

import lifelines
import numpy as np
import scipy
import scipy.stats
from lifelines import KaplanMeierFitter
from lifelines.statistics import multivariate_logrank_test
from lifelines.utils import restricted_mean_survival_time

HERE = Path(__file__).parent
LEVELS = [0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95]


def leukaemia():
    """Weeks of remission with 6-MP (group 0) and placebo (1): Freireich et al., Blood 21 (1963) 699."""
    drug = "6 6 6 6+ 7 9+ 10 10+ 11+ 13 16 17+ 19+ 20+ 22 23 25+ 32+ 32+ 34+ 35+".split()
    placebo = "1 1 2 2 3 4 4 5 5 8 8 8 8 11 11 12 12 15 17 22 23".split()
    rows = [(float(t.rstrip("+")), not t.endswith("+"), 0) for t in drug]
    return rows + [(float(t), True, 1) for t in placebo]


def ties(rng):
    """Whole numbers of 1 to 6: events and censorings at the same times, the last of both."""
    time = np.concatenate([rng.integers(1, 7, 47), [6, 6]])
    happened = np.concatenate([rng.random(47) < 0.6, [True, False]])
    return [(float(t), bool(e), int(g)) for t, e, g in zip(time, happened, np.arange(49) % 2)]


def heavy(rng):
    """Nine tenths censored: S stays above one half."""
    time, censoring = rng.weibull(1.7, 83) * 2.0, rng.uniform(0.0, 1.0, 83)
    happened = time <= censoring
    return [(float(t), bool(e), int(g)) for t, e, g in zip(np.minimum(time, censoring), happened, np.arange(83) % 3)]


def uncensored(rng):
    """Log-normal times of 101 members, none censored."""
    time = np.exp(0.4 * rng.standard_normal(101) - 1.0) * (1.0 + 0.1 * (np.arange(101) % 4))
    return [(float(t), True, int(g)) for t, g in zip(time, np.arange(101) % 4)]


def thousand(rng):
    """1000 members of five groups with different rates, censored at random and at t = 1.5, times to three decimals."""
    group = np.arange(1000) % 5
    time, censoring = rng.exponential(0.6 + 0.1 * group), np.minimum(rng.exponential(2.0, 1000), 1.5)
    happened = time <= censoring
    time = np.round(np.minimum(time, censoring), 3)
    return [(float(t), bool(e), int(g)) for t, e, g in zip(time, happened, group)]


def exact(rows):
    """Steps, S at the end and the largest time, in rational numbers."""
    rows = [(Fraction(t), e) for t, e, _ in rows]
    steps, survival = [], Fraction(1)
    for time in sorted({t for t, e in rows if e}):
        at_risk, events = sum(t >= time for t, _ in rows), sum(t == time and e for t, e in rows)
        survival *= Fraction(at_risk - events, at_risk)
        steps.append((time, at_risk, events, survival))
    return steps, survival, max(t for t, _ in rows)


def restricted(rows):
    """Variance of min(t, last), and Irwin's variance of its mean."""
    steps, _, last = exact(rows)
    times = [Fraction(0)] + [s[0] for s in steps] + [last]
    survival = [Fraction(1)] + [s[3] for s in steps]
    areas = [s * (b - a) for s, a, b in zip(survival, times, times[1:])]
    squares = sum(s * (b * b - a * a) for s, a, b in zip(survival, times, times[1:]))
    error = sum(
        sum(areas[i + 1 :]) ** 2 * Fraction(d, n * (n - d)) for i, (_, n, d, _) in enumerate(steps) if n > d
    )
    return squares - sum(areas) ** 2, error


def curve(rows, with_steps=True):
    """Everything about one sample."""
    time, happened = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
    fitter = KaplanMeierFitter().fit(time, happened)
    last, ends_at = float(time.max()), float(fitter.survival_function_.iloc[-1, 0])
    mean = float(restricted_mean_survival_time(fitter, t=last))
    out = {"quantiles": {}, "mean": mean, "restricted": ends_at > 0.0}
    for p in LEVELS:
        found = fitter.percentile(1.0 - p)
        # The same of rational numbers, where equality is no matter of rounding.
        first = next((float(t) for t, _, _, s in exact(rows)[0] if s <= 1 - Fraction(str(p))), math.inf)
        if found != first:
            print(f"  lifelines rounds at equality: quantile {p} is {found}, in rational numbers {first}")
        out["quantiles"][f'"{p}"'] = first if first < math.inf else None
    if happened.all():
        assert np.isclose(mean, time.mean(), rtol=1e-14)
        assert all(np.quantile(time, p, method="inverted_cdf") == out["quantiles"][f'"{p}"'] for p in LEVELS)
        out["deviation"], out["error"] = float(np.std(time, ddof=1)), float(scipy.stats.sem(time))
    else:
        deviation, error = restricted(rows)
        approximate = restricted_mean_survival_time(fitter, t=last, return_variance=True)[1]
        assert np.isclose(float(deviation), approximate, rtol=0.01)
        out["deviation"], out["error"] = math.sqrt(deviation), math.sqrt(error)
    if with_steps:
        table = fitter.event_table[fitter.event_table["observed"] > 0]
        survival = fitter.survival_function_.iloc[:, 0].loc[table.index]
        greenwood = fitter._cumulative_sq_.loc[table.index]
        variance = np.where(table["at_risk"] == table["observed"], 0.0, survival**2 * greenwood)
        out["steps"] = [
            [float(t), int(n), int(d), float(s), float(v)]
            for t, n, d, s, v in zip(table.index, table["at_risk"], table["observed"], survival, variance)
        ]
    return out


def survival_set(rows):
    groups = sorted({g for _, _, g in rows})
    test = multivariate_logrank_test([r[0] for r in rows], [r[2] for r in rows], [r[1] for r in rows])
    samples = {"all": curve(rows)}
    for g in groups:
        samples[str(g)] = curve([r for r in rows if r[2] == g], with_steps=len(rows) < 500)
    return {
        "samples": samples,
        "log_rank": {
            "statistic": float(test.test_statistic),
            "degrees_of_freedom": int(test.degrees_of_freedom),
            "p_value": float(test.p_value),
        },
    }


def description(values):
    values = np.array(values)
    return {
        "values": values.tolist(),
        "mean": float(values.mean()),
        "deviation": float(values.std(ddof=1)),
        "error": float(scipy.stats.sem(values)),
        "quantiles": {f'"{p}"': float(np.quantile(values, p)) for p in [0.0, *LEVELS, 0.99, 1.0]},
    }


def fit(x, y):
    line = scipy.stats.linregress(x, y)
    law = scipy.stats.linregress(np.log(x), np.log(y))
    return {
        "x": x.tolist(),
        "y": y.tolist(),
        "line": [float(v) for v in (line.slope, line.intercept, line.rvalue**2, line.stderr)],
        "power": [float(v) for v in (law.slope, np.exp(law.intercept), law.rvalue**2, law.stderr)],
    }


def toml(table, path=()):
    """Lines of TOML. Python's repr of numbers and lists is TOML's, and None is left out."""
    plain = {k: v for k, v in table.items() if not isinstance(v, dict) and v is not None}
    if plain:
        yield f"[{'.'.join(path)}]"
    for key, value in plain.items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        yield f"{key} = " + text.replace("], [", "],\n    [")
    for key, value in table.items():
        if isinstance(value, dict):
            yield from toml(value, (*path, key))


def main():
    warnings.simplefilter("ignore")
    rng = np.random.default_rng(20240501)
    sets = {
        "leukaemia": leukaemia(),
        "ties": ties(rng),
        "heavy": heavy(rng),
        "uncensored": uncensored(rng),
        "thousand": thousand(rng),
    }
    out = {
        "versions": {package.__name__: f'"{package.__version__}"' for package in (lifelines, scipy, np)},
        "survival": {},
        "descriptions": {
            "normal": description(3.0 + rng.standard_normal(200)),
            "small": description([0.3, 0.1, 0.7, 0.1]),
            "offset": description(1e6 + rng.random(57)),
        },
        "fits": {},
    }
    for name, rows in sets.items():
        print(name)
        out["survival"][name] = survival_set(rows)
        with open(HERE / f"{name}.csv", "w") as file:
            file.write("time,happened,group\n")
            file.writelines(f"{t!r},{int(e)},{g}\n" for t, e, g in rows)
    for name, noise in {"tight": 0.05, "loose": 0.5}.items():
        x = np.geomspace(0.05, 3.0, 23)
        out["fits"][name] = fit(x, 0.7 * x**-1.3 * np.exp(noise * rng.standard_normal(23)))
    (HERE / "reference.toml").write_text("\n".join(toml(out)) + "\n")


main()
