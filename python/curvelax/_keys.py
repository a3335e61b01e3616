"""The keys of a spec as keywords of :func:`curvelax.run`, for editors and type checkers."""

# Generated from the program: UPDATE_DOCS=1 cargo test --test it documents

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict


class Keys(TypedDict, total=False):
    """What ``curvelax.run`` takes; flags of ``curvelax run`` with ``_`` for ``-``."""

    curves: int
    """Number of members: perturbed copies of the curve, or of each outline. By default 256; for several outlines, or
    those of files:PATTERN, one unperturbed member each."""

    outlines: int
    """Fail unless exactly this many outlines are read. The spec of a run records it. By default any number."""

    group_by: str
    """Compare the outlines by the values of this property of their features, column of their table, or `file`. By
    default no groups."""

    points: int
    """Nodes per member, n ≥ 6. By default 100."""

    seed: int
    """Seed of the random perturbations. By default 1."""

    shape: Any
    """Initial curve: ellipse:A,B, circle:R, nonconvex, astroid, lemniscate:A or flower:M:A[:PHASE],...; or the
    outlines in file:PATH or 'files:PATTERN' (CSV, GeoJSON, WKT, NumPy). A single outline of file: becomes curves
    perturbed copies; several, or those of files:, are one unperturbed member each. Paths are relative to the current
    folder. Any number may be a distribution, such as uniform(1.2..3): see below. By default ellipse:2,1."""

    sampling: Literal["parameter", "arclength", "points"]
    """Placement of the nodes on the curve. By default arclength."""

    interpolate: Literal["auto", "spline", "polygon"]
    """How the curve of an outline runs between its data points: as a polygon, as a cubic spline, or (auto) as a
    spline with corners where the direction turns by more than half a radian. By default auto."""

    rounding: float
    """Smallest radius of curvature of an outline's corners, as a share of the outline's length, 0.0001 to 0.02; 0
    leaves them to the nodes. By default 0.002."""

    amplitude: float | str | Any
    """Size σ of the random perturbation, 0 for none; or a distribution. By default 0.05."""

    modes: str
    """Modes of the random perturbation. By default 2..=8."""

    decay: float | str | Any
    """Power p: mode m has standard deviation σ m^-p; or a distribution. By default 1."""

    reduced_area: float | str | Any
    """Stretch the curve of each member along its principal axes, at the same area, to the reduced area V = 4 pi
    A/L^2, 0.05 to 1; or a distribution. Needs conserve area,length. By default as it is."""

    perturbation: Literal["amplitude-phase", "gaussian"]
    """Distribution of each mode: a normal amplitude and a uniform phase, or (gaussian) independent normal
    coefficients of cos and sin with the same power. By default amplitude-phase."""

    design: Literal["random", "sobol", "lhs"]
    """How the members of a cell are spread over the distributions of shape, flow, energy, diffusivity, drive,
    amplitude, decay and reduced-area: each on its own, as a scrambled Sobol sequence, or as a Latin hypercube. The
    modes of the perturbation stay random. By default random."""

    only: Sequence[int]
    """Run only these members; each is bit-identical to its run in the whole ensemble. By default all."""

    shard: str
    """Run only the members j with j mod N = I, for `curvelax merge`; `slurm` reads I/N from the job array. By default
    all."""

    common_random_numbers: bool
    """Draw member j of every cell from the same random numbers. By default false."""

    sweep: Mapping[str, Sequence[Any]]
    """Vary this key: a cell of members for each value, or for each combination of values if the flag is given for
    several keys. Separate values that contain commas by semicolons: sweep 'shape=ellipse:2,1;circle:1'. By default
    none."""

    flow: str
    """Flow: surface-diffusion, willmore, elastic:LAMBDA or poly:C1,C2,...; numbers may be distributions. By default
    surface-diffusion."""

    energy: str
    """Surface energy γ of a crystal (anisotropic) under surface diffusion, by the angle ψ of the outward normal:
    cos:FOLD,EPS[,DEG] is 1 + EPS cos FOLD(ψ - DEG); a sum of two is cos:...+cos:... . FOLD is 2 to 12, and EPS
    (FOLD^2 - 1) below 1. Any number may be a distribution. energy 1 is isotropic, but in the geometric form. By
    default 1."""

    diffusivity: str
    """Relative diffusivity along the surface of a crystal, by the same angle: cos:FOLD,EPS[,DEG] is 1 + EPS cos
    FOLD(ψ - DEG), above 0 in all directions; a sum of two as for energy. Any number may be a distribution. By default
    1."""

    drive: float | str | Any
    """Driving force along the normal, positive inwards, as a velocity in length/time: a circle under surface
    diffusion has R(t) = R(0) - F t. F, or feedback:C,A0 for C (A - A0), which brings the area A to A0. Any number may
    be a distribution. By default 0."""

    conserve: str
    """Keep the area, the length, or area,length, of willmore, elastic and poly. With both a curve relaxes to a
    vesicle, and its bending energy E = ½∮k² ds says when: from the time on after which |E - E_end| stays below
    relax-to times its maximum over the run. By default neither."""

    conserve_at: Sequence[float]
    """The area and the length that are kept; one number if one is. Starts that are off by more than 0.4 % are scaled
    to it, and for both first stretched as by reduced-area. By default those of the polygon at the start."""

    mobility: float
    """Mobility B in length^4/time; for surface diffusion, D_s gamma Omega^2 nu/(k_B T). All times, in flags and in
    results, are then in its unit of time. By default 1."""

    units: str
    """Names of the units of length and time, such as um,h, for the report and the axes. By default none."""

    tau: float | Literal["auto"]
    """Fixed time step τ. auto is R^4/4000 for each member. By default 0.001."""

    adaptive: float | bool
    """Adapt the steps to this local error instead of using tau. Without TOL it is 0.001; write adaptive=TOL before
    SPEC.toml. By default off."""

    t_end: float | Literal["auto"] | Sequence[float]
    """Final time. auto: each member ends when it is relaxed, at the latest at six times the relaxation time that
    linear theory predicts for its cell; a member that drive shrinks to a point runs until it vanishes. T1,T2,...: one
    for each cell of a sweep. By default 2."""

    omega: float | Literal["auto"]
    """Rate ω, in 1/time, of the redistribution towards equal spacing. auto is 4/R^4 for each member. By default 1
    with tau, auto with adaptive and tau auto."""

    no_redistribution: bool
    """Move nodes along the normal only. By default false."""

    relax_to: float
    """Count a member as relaxed when its excess, L^2/(4 pi A) minus that of the regular polygon, has fallen to this
    fraction of its start; for vesicles see conserve. By default 0.01."""

    relax_at: float
    """Count a member as relaxed when its excess has fallen to this value, instead of relax-to. Use it for rough
    outlines, whose initial excess is that of their details. By default off."""

    stop_when_relaxed: bool
    """End a member as soon as it is relaxed; one that drive shrinks to a point runs until it vanishes, and vesicles
    (conserve area,length) run to the final time. By default false; with t-end auto true."""

    accurate: bool
    """What we recommend for numbers to publish: adaptive pull auto omega auto t-end auto stop-when-relaxed refine;
    vesicles (conserve area,length) run without stop-when-relaxed. Each can still be set on its own. By default
    off."""

    refine: bool
    """Run every member also with n/2, n/√2 and n nodes and a tenth of the step tolerance, and extrapolate t_relax to
    n → ∞: columns t_limit, t_error, order and points of summary.csv; with drive t_vanish, too: t_vanish_limit and
    t_vanish_error. Members whose times do not converge there also run with √2 n, 2n, … up to 1600 nodes. By default
    false."""

    accuracy: float
    """With refine or accurate: choose n, the tolerance and the number of members so that the 95 % interval of the
    median t_limit, for sampling and discretisation together, is within X times the median. For outlines, whose number
    is given: n and the tolerance so that each t_error is within X times t_limit. It starts from curves, points and
    adaptive. If X cannot be reached, the run keeps its best result and exits with code 3. By default off."""

    pull: float | Literal["auto"]
    """Rate κ, in 1/time, at which the curvatures k and segment lengths r that the scheme evolves relax to those of
    the polygon. 0 is the paper's scheme; auto is 4 x 24/R^4 for each member. By default 0."""

    form: Literal["paper", "geometric", "auto"]
    """Which discretisation moves the nodes. paper: that of the curvatures and segment lengths that the scheme
    evolves; geometric: the force of the polygon itself, which halves the error of smooth, well resolved curves and
    fails for others; auto: the default. By default paper; geometric with energy, diffusivity, drive and conserve."""

    solver: Literal["auto", "gauss-seidel", "direct"]
    """Solver of the pentadiagonal systems. auto is gauss-seidel with tau and direct with adaptive. By default
    auto."""

    order: Literal["coloured", "lexicographic"]
    """Order in which a Gauss-Seidel sweep visits the nodes. coloured: all nodes of one colour at once, as a GPU needs
    it; lexicographic: one after another. By default coloured."""

    tolerance: float | bool
    """Tolerance at which Gauss-Seidel sweeps stop: it bounds the residual, or in adaptive steps in f32 the change by
    a round of sweeps. By default 1e-5 in f64; in f32 1e-3, with adaptive 1e-6."""

    sor: float | Literal["auto"]
    """Over-relaxation factor of Gauss-Seidel sweeps. 1 is the paper's; auto follows the stiffness of each system. By
    default 1; auto with adaptive."""

    max_sweeps: int
    """Maximum Gauss-Seidel sweeps per system; a member that needs more ends as `stalled`. By default 200000."""

    backend: Literal["auto", "gpu", "cpu"]
    """Where to run; auto uses a hardware GPU if there is one, otherwise the CPU. By default auto."""

    adapter: str
    """GPU adapter to use: part of its name, or its number in `curvelax adapters`. By default the best."""

    precision: Literal["f32", "f64"]
    """Number type. By default f64 where the device has it."""

    threads: int
    """Threads that prepare and analyse members and, on the CPU, advance them. By default all cores."""

    event: str | Sequence[str]
    """Write events.csv: the first time at which each member meets a condition, NAME=OBSERVABLE<=THRESHOLD, or with
    >=. A threshold is a number, or FACTOR*start. Observables are length, area, excess, energy, k_min, k_max,
    mesh_ratio (longest over shortest segment) and metric_drift (largest relative difference between the lengths r
    that the scheme evolves and those of the segments). For several events give it several times: event 'convex =
    k_min >= 0' event 'slow = excess <= 0.5 * start'. By default none."""

    events: Mapping[str, str]
    """Write events.csv: the first time at which each member meets a condition, NAME=OBSERVABLE<=THRESHOLD, or with
    >=. A threshold is a number, or FACTOR*start. Observables are length, area, excess, energy, k_min, k_max,
    mesh_ratio (longest over shortest segment) and metric_drift (largest relative difference between the lengths r
    that the scheme evolves and those of the segments). For several events give it several times: event 'convex =
    k_min >= 0' event 'slow = excess <= 0.5 * start'. By default none."""

    series: float
    """Write series.csv: one row per member every DT. By default off."""

    snapshots: Sequence[float]
    """Write snapshots.csv: all nodes at these times. By default off."""

    store: Literal["csv", "zarr"]
    """Format of the snapshots: the table snapshots.csv, or the arrays of snapshots.zarr, for xarray. By default
    csv."""

    tables: Literal["csv", "parquet"]
    """Format of the tables: CSV, or Parquet next to the CSV files, which the other commands read. By default csv."""
