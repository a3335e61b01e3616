// The coarse systems of multigrid: rho u + u'''' + p u'' + w u' rediscretised on every coarse ring. Twin of
// crates/flow/src/solver/multigrid/coarse.rs.

/// The damping of p on coarse levels.
const BALANCE = 0.1111111111111111;

/// Inverse of the coarsest matrix, row by row.
var<workgroup> inverse_matrix: array<real, 25>;

/// The terms of coarse node j.
fn coarsen(fine: Level, coarse: Level, j: u32) {
    let own = value_at(fine, fine_node(j));
    let next = value_at(fine, node_between(j));
    var spacing = own.x + next.x;
    if has_two_between(fine, j) { spacing = spacing + value_at(fine, last_node(fine)).x; }
    let mass = average(value_at(fine, node_before(fine, fine_node(j), 1u)), own, next).y;
    coarse_value[coarse.at + j] = pair(spacing, mass);
    if fine.depth > 0u { coarse_held[coarse.at + j] = average_held(fine, j); }
}

/// p and w of coarse node j.
fn average_held(fine: Level, j: u32) -> pair {
    let before = held_at(fine, node_before(fine, fine_node(j), 1u));
    return average(before, held_at(fine, fine_node(j)), held_at(fine, node_between(j)));
}

fn average(before: pair, own: pair, next: pair) -> pair {
    return real(0.25) * (before + next) + real(0.5) * own;
}

/// Builds all coarse systems from the terms of the finest one. The barriers of the way down separate the inverse from
/// its readers.
fn build() {
    var fine = finest();
    var coarse = coarser(fine);
    share(term_second, term_first);
    for (var j = lane; j < coarse.nodes; j += THREADS) { coarse_held[coarse.at + j] = average_held(fine, j); }
    settle();
    share(term_spacing, term_mass);
    let depth = at_run_time(coarse_rings());
    while fine.depth < depth {
        for (var j = lane; j < coarse.nodes; j += THREADS) { coarsen(fine, coarse, j); }
        workgroupBarrier();
        for (var j = lane; j < coarse.nodes; j += THREADS) {
            weigh(fine, coarse, j);
            discretise(coarse, j);
        }
        fine = coarse;
        coarse = coarser(fine);
    }
    workgroupBarrier();
    if lane == 0u { invert_matrix(fine); }
}

/// Row j of a coarse level, integrated over its cell and divided by its diagonal entry.
fn discretise(ring: Level, j: u32) {
    let dmm = coarse_value[ring.at + node_before(ring, j, 2u)].x;
    let dm = coarse_value[ring.at + node_before(ring, j, 1u)].x;
    let own = coarse_value[ring.at + j];
    let dp = coarse_value[ring.at + node_after(ring, j, 1u)].x;
    let idmm = real(1.0) / dmm;
    let idm = real(1.0) / dm;
    let id = real(1.0) / own.x;
    let idp = real(1.0) / dp;
    let cell = real(0.5) * (dm + own.x);
    let ivm = real(1.0) / (real(0.5) * (dmm + dm));
    let iv = real(1.0) / cell;
    let ivp = real(1.0) / (real(0.5) * (own.x + dp));
    let second = balanced(coarse_held[ring.at + j].x, cell);
    let drift = real(0.5) * coarse_held[ring.at + j].y;
    let row_a = idm * ivm * idmm;
    let row_e = id * ivp * idp;
    let middle = iv * id * idm;
    let low = idm * idm * (iv + ivm);
    let high = id * id * (iv + ivp);
    let row_b = (second * idm - drift) - (middle + low + row_a);
    let row_d = (second * id + drift) - (middle + high + row_e);
    let row_c = cell * own.y - (row_a + row_b + row_d + row_e);
    let over_c = real(1.0) / row_c;
    coarse_rows[ring.at + j] = vec(row_a, row_b, row_d, row_e) * over_c;
    coarse_share[ring.at + j] = over_c * (real(1.0) / tau);
}

/// The coefficient p of the second derivative for a level with cells of this length.
fn balanced(p_of: real, cell: real) -> real {
    return p_of / (real(1.0) + real(BALANCE) * (max(p_of, real(0.0)) * (cell * cell)));
}

/// Inverts the coarsest matrix by Gauss–Jordan elimination, in one thread: its indices are unknown to compilers, so that
/// a copy in every thread would take registers or device memory.
fn invert_matrix(ring: Level) {
    let n = ring.nodes;
    for (var l = 0u; l < n * n; l++) { inverse_matrix[l] = real(0.0); }
    for (var j = 0u; j < n; j++) {
        // On so few nodes, neighbours on either side may coincide.
        let row = coarse_rows[ring.at + j];
        inverse_matrix[n * j + node_before(ring, j, 2u)] += row.x;
        inverse_matrix[n * j + node_before(ring, j, 1u)] += row.y;
        inverse_matrix[n * j + j] += real(1.0);
        inverse_matrix[n * j + node_after(ring, j, 1u)] += row.z;
        inverse_matrix[n * j + node_after(ring, j, 2u)] += row.w;
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
