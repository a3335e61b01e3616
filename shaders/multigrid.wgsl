// Coloured sweeps inside V-cycles on the ring. Twin of src/solver/multigrid.rs; the sweeps are in sweeps.wgsl.
//
// Level l is a ring of NODES >> l nodes, down to COARSEST or fewer. The finest one stays in registers, block by block, and
// its fields are shared in the rings for the way down; the coarser ones lie one behind the other in the arrays below, and the nodes of each are dealt out to all threads. What
// belongs to the way between two levels lies with the coarser one.

const SWEEPS_PER_CYCLE = 2u;
const COARSE_SWEEPS = 4u;
const COARSEST = 5u;
/// Levels at most: enough for any ring that fits.
const LEVELS = 8u;

alias pair = vec2<real>;

/// Entries a, b, d, e of the rows, and from a residual integrated over the cell, times tau, to a right-hand side.
var<workgroup> coarse_rows: array<vec, COARSE>;
var<workgroup> coarse_share: array<real, COARSE>;
/// Unknowns for the two right-hand sides. While the level is built: spacing and rho.
var<workgroup> coarse_value: array<pair, COARSE>;
/// Their residuals integrated over cells, then right-hand sides. While the level is built: p and w.
var<workgroup> coarse_held: array<pair, COARSE>;
/// Weights of coarse nodes j-1 ... j+2 at the finer node between j and j+1.
var<workgroup> coarse_weights: array<vec, COARSE>;
/// The same for the last node of an odd ring, by level of that ring.
var<workgroup> odd_weights: array<vec, LEVELS>;
/// Inverse of the coarsest matrix, row by row; every thread has its own.
var<private> inverse_matrix: array<real, 25>;

/// Sweeps `u` for rhs_x and, if `both`, `v` for rhs_y; returns how it ended.
fn solve(both: bool, negligible: real) -> u32 {
    if both {
        position_terms(k_window);
    } else {
        curvature_terms();
        rhs_y = vec(0.0);
        v = vec(0.0);
    }
    sweeps = counters.solve_sweeps;
    sor = real(1.0);
    let size = system_size(max(bounded_abs(rhs_x), bounded_abs(rhs_y)));
    let tolerance = max(p.tolerance, real(EPSILON) * size);
    build();
    start_sweeps();
    var ended = finite_or_not(size);
    while ended == UNSOLVED {
        let error_u = row_of.weight * residual(rhs_x, swept(behind.xy, u, ahead.xy));
        let error_v = row_of.weight * residual(rhs_y, swept(behind.zw, v, ahead.zw));
        let error = max(bounded_abs(error_u), bounded_abs(error_v));
        let increment = max(bounded_abs(u), bounded_abs(v));
        ended = judge(block_max(error), block_max(increment), tolerance, negligible);
        if ended != UNSOLVED || sweeps >= dispatch.max_sweeps || budget == 0u { break; }
        share(term_cell * error_u, term_cell * error_v);
        correct();
        // A barrier of the way down separates this from the readers of the residuals.
        behind = pass_up(tails(u, v));
        let batch = min(SWEEPS_PER_CYCLE, dispatch.max_sweeps - sweeps);
        for (var s = 0u; s < batch; s++) { sweep_two(); }
        sweeps += batch;
        budget -= min(budget, batch);
    }
    return paused_or(ended);
}

/// Coarse rings below the finest one.
fn depth_of_rings() -> u32 {
    var depth = 1u;
    while (NODES >> depth) > COARSEST { depth++; }
    return depth;
}

/// `count`, in a way that compilers cannot know before: they would unroll the loops over levels, nodes and colours one
/// inside the other, and take up to a minute.
fn at_run_time(count: u32) -> u32 {
    return select(count, 0u, dispatch.max_sweeps == 0u);
}

/// Two shared fields at node i of the finest level.
fn shared_at(i: u32) -> pair {
    let four = i < 4u * FOURS;
    let at = select((i - FOURS) / 3u, i / 4u, four);
    let colour = select((i - FOURS) % 3u, i % 4u, four);
    return pair(ring_a[at][colour], ring_b[at][colour]);
}

/// Two fields of a level, the finest from the rings.
fn terms_at(level: u32, above: u32, i: u32) -> pair {
    if level == 0u { return shared_at(i); }
    return coarse_value[above + i];
}

fn held_at(level: u32, above: u32, i: u32) -> pair {
    if level == 0u { return shared_at(i); }
    return coarse_held[above + i];
}

/// Builds all coarse systems from the terms of the finest one.
fn build() {
    share(term_second, term_first);
    for (var j = lane; j < NODES / 2u; j += THREADS) {
        coarse_held[j] = average(held_at(0u, 0u, (2u * j + NODES - 1u) % NODES), held_at(0u, 0u, 2u * j), held_at(0u, 0u, 2u * j + 1u));
    }
    share(term_spacing, term_mass);
    var above = 0u;
    var below = 0u;
    var level = 0u;
    let depth = at_run_time(depth_of_rings());
    while level < depth {
        let size = NODES >> level;
        let fewer = size / 2u;
        for (var j = lane; j < fewer; j += THREADS) { coarsen(level, above, below, size, j); }
        workgroupBarrier();
        for (var j = lane; j < fewer; j += THREADS) {
            weigh(level, above, below, size, j);
            discretise(below, fewer, j);
        }
        above = below;
        below += fewer;
        level++;
    }
    workgroupBarrier();
    invert_matrix(above, NODES >> level);
}

fn average(before: pair, own: pair, behind: pair) -> pair {
    return real(0.25) * (before + behind) + real(0.5) * own;
}

/// The terms of coarse node j, which is node 2j of the ring above.
fn coarsen(level: u32, above: u32, below: u32, size: u32, j: u32) {
    let before = (2u * j + size - 1u) % size;
    let own = terms_at(level, above, 2u * j);
    let behind = terms_at(level, above, 2u * j + 1u);
    var spacing = own.x + behind.x;
    if size % 2u == 1u && j == size / 2u - 1u { spacing = spacing + terms_at(level, above, size - 1u).x; }
    let mass = average(terms_at(level, above, before), own, behind).y;
    coarse_value[below + j] = pair(spacing, mass);
    if level > 0u {
        coarse_held[below + j] = average(coarse_held[above + before], coarse_held[above + 2u * j], coarse_held[above + 2u * j + 1u]);
    }
}

/// The weights between the ring above and coarse nodes j and j+1.
fn weigh(level: u32, above: u32, below: u32, size: u32, j: u32) {
    let fewer = size / 2u;
    let before = coarse_value[below + (j + fewer - 1u) % fewer].x;
    let gap = coarse_value[below + j].x;
    let behind = coarse_value[below + (j + 1u) % fewer].x;
    var way = terms_at(level, above, 2u * j).x;
    let points = select(1u, 2u, size % 2u == 1u && j == fewer - 1u);
    for (var point = 0u; point < points; point++) {
        let weights = lagrange(way, before, gap, behind);
        if point == 0u { coarse_weights[below + j] = weights; } else { odd_weights[level] = weights; }
        way += terms_at(level, above, 2u * j + 1u).x;
    }
}

/// Weights of coarse nodes j-1 ... j+2 for a point at the distance l behind node j.
fn lagrange(l: real, before: real, gap: real, behind: real) -> vec {
    let r_left = gap - l;
    let far_l = before + l;
    let far_r = r_left + behind;
    let wide_l = before + gap;
    let wide_r = gap + behind;
    let all_three = wide_l + behind;
    return vec(
        -(l * r_left * far_r) / (before * wide_l * all_three),
        far_l * r_left * far_r / (before * gap * wide_r),
        far_l * l * far_r / (wide_l * gap * behind),
        -(far_l * l * r_left) / (all_three * wide_r * behind),
    );
}

/// The coefficient p of the second derivative for a level with cells of this length.
fn balanced(p_of: real, cell: real) -> real {
    return p_of / (real(1.0) + real(BALANCE) * (max(p_of, real(0.0)) * (cell * cell)));
}

const BALANCE = 0.1111111111111111;

/// Row j of a coarse level of `size` nodes, integrated over its cell and divided by its diagonal entry.
fn discretise(at: u32, size: u32, j: u32) {
    let dmm = coarse_value[at + (j + size - 2u) % size].x;
    let dm = coarse_value[at + (j + size - 1u) % size].x;
    let own = coarse_value[at + j];
    let dp = coarse_value[at + (j + 1u) % size].x;
    let idmm = real(1.0) / dmm;
    let idm = real(1.0) / dm;
    let id = real(1.0) / own.x;
    let idp = real(1.0) / dp;
    let cell = real(0.5) * (dm + own.x);
    let ivm = real(1.0) / (real(0.5) * (dmm + dm));
    let iv = real(1.0) / cell;
    let ivp = real(1.0) / (real(0.5) * (own.x + dp));
    let second = balanced(coarse_held[at + j].x, cell);
    let drift = real(0.5) * coarse_held[at + j].y;
    let row_a = idm * ivm * idmm;
    let row_e = id * ivp * idp;
    let middle = iv * id * idm;
    let low = idm * idm * (iv + ivm);
    let high = id * id * (iv + ivp);
    let row_b = (second * idm - drift) - (middle + low + row_a);
    let row_d = (second * id + drift) - (middle + high + row_e);
    let row_c = cell * own.y - (row_a + row_b + row_d + row_e);
    let over_c = real(1.0) / row_c;
    coarse_rows[at + j] = vec(row_a, row_b, row_d, row_e) * over_c;
    coarse_share[at + j] = over_c * (real(1.0) / p.tau);
}

/// The inverse of the coarsest matrix by Gauss and Jordan.
fn invert_matrix(at: u32, n: u32) {
    for (var l = 0u; l < n * n; l++) { inverse_matrix[l] = real(0.0); }
    for (var j = 0u; j < n; j++) {
        // On so few nodes neighbours on either side may be the same one.
        let row = coarse_rows[at + j];
        inverse_matrix[n * j + (j + n - 2u) % n] += row.x;
        inverse_matrix[n * j + (j + n - 1u) % n] += row.y;
        inverse_matrix[n * j + j] += real(1.0);
        inverse_matrix[n * j + (j + 1u) % n] += row.z;
        inverse_matrix[n * j + (j + 2u) % n] += row.w;
    }
    for (var l = 0u; l < n; l++) {
        let pivot = real(1.0) / inverse_matrix[n * l + l];
        inverse_matrix[n * l + l] = real(1.0);
        for (var c = 0u; c < n; c++) { inverse_matrix[n * l + c] *= pivot; }
        for (var j = 0u; j < n; j++) {
            if j == l { continue; }
            let factor = inverse_matrix[n * j + l];
            inverse_matrix[n * j + l] = real(0.0);
            for (var c = 0u; c < n; c++) { inverse_matrix[n * j + c] -= factor * inverse_matrix[n * l + c]; }
        }
    }
}

/// Adds to `u` and `v` the correction for the residuals in the rings.
fn correct() {
    var above = 0u;
    var below = 0u;
    var level = 0u;
    let depth = at_run_time(depth_of_rings());
    while level < depth {
        let size = NODES >> level;
        let fewer = size / 2u;
        for (var j = lane; j < fewer; j += THREADS) { coarse_held[below + j] = restricted(level, above, below, size, j); }
        workgroupBarrier();
        above = below;
        below += fewer;
        level++;
    }
    let coarsest = NODES >> level;
    for (var j = lane; j < coarsest; j += THREADS) {
        var sum = pair(0.0);
        for (var l = 0u; l < coarsest; l++) {
            sum = sum + inverse_matrix[coarsest * j + l] * (coarse_held[above + l] * coarse_share[above + l]);
        }
        coarse_value[above + j] = sum;
    }
    workgroupBarrier();
    for (level = level - 1u; level > 0u; level--) {
        let size = NODES >> level;
        below = above;
        above -= size;
        for (var i = lane; i < size; i += THREADS) {
            coarse_held[above + i] *= coarse_share[above + i];
            coarse_value[above + i] = interpolated(level, below, size, i);
        }
        workgroupBarrier();
        sweep_coarse(above, size);
    }
    for (var c = 0u; c < at_run_time(4u); c++) {
        let correction = interpolated(0u, 0u, NODES, (first + c) % NODES);
        u[c] += correction.x;
        v[c] += correction.y;
    }
}

/// Residuals at coarse node j, integrated over its cell.
fn restricted(level: u32, above: u32, below: u32, size: u32, j: u32) -> pair {
    let fewer = size / 2u;
    let jmm = (j + 2u * fewer - 2u) % fewer;
    let jm = (j + fewer - 1u) % fewer;
    let jp = (j + 1u) % fewer;
    let near = coarse_weights[below + jm].z * held_at(level, above, 2u * jm + 1u)
        + coarse_weights[below + j].y * held_at(level, above, 2u * j + 1u);
    let far = coarse_weights[below + jmm].w * held_at(level, above, 2u * jmm + 1u)
        + coarse_weights[below + jp].x * held_at(level, above, 2u * jp + 1u);
    var sum = held_at(level, above, 2u * j) + (near + far);
    if size % 2u == 1u {
        for (var t = 0u; t < 4u; t++) {
            if (fewer - 2u + t) % fewer == j { sum = sum + odd_weights[level][t] * held_at(level, above, size - 1u); }
        }
    }
    return sum;
}

/// The values of the coarse ring at node i of the ring of `size` nodes above it.
fn interpolated(level: u32, below: u32, size: u32, i: u32) -> pair {
    let fewer = size / 2u;
    let last = i == 2u * fewer;
    let j = select(i / 2u, fewer - 1u, last);
    if i % 2u == 0u && !last { return coarse_value[below + j]; }
    var w = coarse_weights[below + j];
    if last { w = odd_weights[level]; }
    return blend(w, below, fewer, j);
}

/// The cubic with weights w through coarse nodes j-1 ... j+2.
fn blend(w: vec, at: u32, size: u32, j: u32) -> pair {
    let near = w.y * coarse_value[at + j] + w.z * coarse_value[at + (j + 1u) % size];
    let far = w.x * coarse_value[at + (j + size - 1u) % size] + w.w * coarse_value[at + (j + 2u) % size];
    return near + far;
}

/// Sweeps a coarse level of `size` nodes, colour by colour.
fn sweep_coarse(at: u32, size: u32) {
    let threes = (4u - size % 4u) % 4u;
    let fours = (size - 3u * threes) / 4u;
    let start = select(3u * lane + fours, 4u * lane, lane < fours);
    let nodes = select(select(0u, 3u, lane < fours + threes), 4u, lane < fours);
    for (var phase = 0u; phase < at_run_time(4u * COARSE_SWEEPS); phase++) {
        let colour = phase % 4u;
        if colour < nodes { relax_coarse(at, size, start + colour); }
        workgroupBarrier();
    }
}

fn relax_coarse(at: u32, size: u32, j: u32) {
    let row = coarse_rows[at + j];
    let own = coarse_value[at + j];
    let left = coarse_held[at + j] - row.x * coarse_value[at + (j + size - 2u) % size]
        - row.y * coarse_value[at + (j + size - 1u) % size] - row.z * coarse_value[at + (j + 1u) % size]
        - row.w * coarse_value[at + (j + 2u) % size] - own;
    coarse_value[at + j] = own + sor * left;
}
