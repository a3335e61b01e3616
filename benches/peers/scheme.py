"""One step of the paper's scheme for any array library, as in crates/flow/src/scheme/{redistribution,curvature,position,observe}.rs.

Fields have the node on their first axis and, where there are several curves, the curve on their last. A law
b(k) = c1 k + c3 k^3 is the pair (c1, c3): (0, 0) surface diffusion, (0, -1/2) Willmore, (LAMBDA, -1/2) elastic.
"""

from math import pi, tan


def step(xp, solve, state, tau, omega, law):
    """The state (x, y, k, r) a time tau later; solve(rows, rhs) is the periodic pentadiagonal solver."""
    x, y, k, r = state
    c1, c3 = law
    n = len(x)

    def window(u):
        """u at nodes i-2 ... i+2, for all i."""
        w = xp.concatenate([u[-2:], u, u[:2]])
        return [w[j : j + n] for j in range(5)]

    # Velocity, redistribution, new lengths.
    _, km, _, kp, _ = windows_k = window(k)
    _, rm, _, rp, _ = window(r)
    beta = (c1 + c3 * k * k) * k - ((kp - k) * 2 / (r + rp) - (k - km) * 2 / (rm + r)) / r
    rkb = r * k * beta
    length = r.sum(0)
    mean_rkb, mean_length = rkb.sum(0) / length, length / n
    alpha = xp.cumsum(rkb - r * mean_rkb + omega * (mean_length - r), 0)
    alpha = xp.concatenate([alpha[:-1], 0 * alpha[:1]])
    r = r * xp.exp(tau * (omega * (mean_length / r - 1) - mean_rkb))
    rp = window(r)[3]
    ir, q = 1 / r, (r + rp) / 2
    _, irm, ir, irp, irpp = window(ir)
    iqmm, iqm, iq, iqp, _ = window(1 / q)

    # Increment of the curvature: new r and q, old k, beta and alpha.
    kmm, km, k, kp, kpp = windows_k
    alpha_m = xp.concatenate([0 * alpha[:1], alpha[:-1]])
    a, e = iqm * irm * iqmm, iq * irp * iqp
    middle = ir * iq * iqm
    b = alpha_m / 2 - (middle + iqm * iqm * (ir + irm) + a)
    d = -alpha / 2 - (middle + iq * iq * (ir + irp) + e)
    c = r / tau - rkb - (a + b + d + e)
    cube, cube_m, cube_p = ((c1 + c3 * v * v) * v for v in (k, km, kp))
    forcing = (cube_p - cube) * iq - (cube - cube_m) * iqm
    stiff = a * (kmm - k) + b * (km - k) + d * (kp - k) + e * (kpp - k)
    (dk,) = solve((a, b, c, d, e), [forcing + rkb * k - stiff])
    k = k + dk

    # Increments of the positions: new r, q and k, old alpha.
    kp = window(k)[3]
    a, e = ir * iqm * irm, irp * iqp * irpp
    middle = ir * iq * irp
    phi = ((1 - c3) * (k * k + kp * kp) - 2 * c1) / 2
    drift = alpha / 2 - 0.75 * (kp * kp - k * k) * iq
    b = phi * ir + drift - (middle + ir * ir * (iqm + iq) + a)
    d = phi * irp - drift - (middle + irp * irp * (iq + iqp) + e)
    c = q / tau - (a + b + d + e)

    def residual(u):
        umm, um, u, up, upp = window(u)
        return -(a * (umm - u) + b * (um - u) + d * (up - u) + e * (upp - u))

    dx, dy = solve((a, b, c, d, e), [residual(x), residual(y)])
    return x + dx, y + dy, k, r


def observe(xp, state):
    """What curvelax computes of every new curve, or nearly: length, area, excess, energy, extremes, drift."""
    x, y, k, r = state
    n = len(x)
    xm, ym = xp.concatenate([x[-1:], x[:-1]]), xp.concatenate([y[-1:], y[:-1]])
    edge = xp.sqrt((x - xm) ** 2 + (y - ym) ** 2)
    length, area = edge.sum(0), (xm * y - x * ym).sum(0) / 2
    excess = length * length / (4 * pi * abs(area)) - n / pi * tan(pi / n)
    energy = (k * k * r).sum(0) / 2
    drift = (abs(r - edge) / edge).max(0)
    return length, area, excess, energy, k.min(0), k.max(0), edge.min(0), edge.max(0), drift


def bordered(xp, solve_core):
    """A solver of periodic systems from one of plain pentadiagonal ones: the last two unknowns are a border.

    solve_core(bands, columns) solves for several right-hand sides at once; entries outside the matrix are zero.
    """

    def solve(rows, rhs):
        a, b, c, d, e = rows
        core = len(c) - 2
        none = 0 * c[:1]
        inside = 0 * c[: core - 4]
        bands = (
            xp.concatenate([none, none, a[2:core]]),
            xp.concatenate([none, b[1:core]]),
            c[:core],
            xp.concatenate([d[: core - 1], none]),
            xp.concatenate([e[: core - 2], none, none]),
        )
        u = xp.concatenate([a[:1], none, inside, e[core - 2 : core - 1], d[core - 1 : core]])
        v = xp.concatenate([b[:1], a[1:2], inside, none, e[core - 1 : core]])
        *solved, u, v = solve_core(bands, [f[:core] for f in rhs] + [u, v])

        def last_rows(z):
            """What the core's z puts into the last two rows."""
            p = a[core] * z[core - 2] + b[core] * z[core - 1] + e[core] * z[0]
            q = a[core + 1] * z[core - 1] + d[core + 1] * z[0] + e[core + 1] * z[1]
            return p, q

        (pu, qu), (pv, qv) = last_rows(u), last_rows(v)
        m00, m01, m10, m11 = c[core] - pu, d[core] - pv, b[core + 1] - qu, c[core + 1] - qv
        inverse = 1 / (m00 * m11 - m01 * m10)
        result = []
        for f, z in zip(rhs, solved):
            p, q = last_rows(z)
            p, q = f[core] - p, f[core + 1] - q
            s, t = (p * m11 - q * m01) * inverse, (q * m00 - p * m10) * inverse
            result.append(xp.concatenate([z - u * s - v * t, s[None], t[None]]))
        return result

    return solve
