// A V-cycle: residuals down to the coarsest ring without sweeps, corrections up with sweeps on every ring. Twin of
// crates/flow/src/solver/multigrid/cycle.rs.

const COARSE_SWEEPS = 4u;

/// Adds the correction for the residuals in the rings to `u` and `v`.
fn correct() {
    var ring = finest();
    let depth = at_run_time(coarse_rings());
    while ring.depth < depth {
        let coarse = coarser(ring);
        for (var j = lane; j < coarse.nodes; j += THREADS) {
            coarse_held[coarse.at + j] = restrict_residuals(ring, coarse, j);
        }
        workgroupBarrier();
        ring = coarse;
    }
    solve_coarsest(ring);
    workgroupBarrier();
    while ring.depth > 1u {
        let coarse = ring;
        ring = finer(coarse);
        for (var i = lane; i < ring.nodes; i += THREADS) {
            coarse_held[ring.at + i] *= coarse_share[ring.at + i];
            coarse_value[ring.at + i] = interpolate(ring, coarse, i);
        }
        workgroupBarrier();
        sweep_coarse(ring);
    }
    for (var c = 0u; c < at_run_time(4u); c++) {
        let correction = interpolate(finest(), coarser(finest()), node(c));
        u[c] += correction.x;
        v[c] += correction.y;
    }
}

/// Solves the coarsest system with the inverse of its matrix.
fn solve_coarsest(ring: Level) {
    for (var j = lane; j < ring.nodes; j += THREADS) {
        var sum = pair(0.0);
        for (var l = 0u; l < ring.nodes; l++) {
            sum = sum + inverse_matrix[ring.nodes * j + l] * (coarse_held[ring.at + l] * coarse_share[ring.at + l]);
        }
        coarse_value[ring.at + j] = sum;
    }
}

/// Sweeps a coarse level, colour by colour.
fn sweep_coarse(ring: Level) {
    let own = coarse_block(ring);
    for (var phase = 0u; phase < at_run_time(4u * COARSE_SWEEPS); phase++) {
        let colour = colour_in(phase);
        if colour < own.nodes { relax_coarse(ring, own.first + colour); }
        if ends_pass(ring, phase) { workgroupBarrier(); }
    }
}

fn relax_coarse(ring: Level, j: u32) {
    let row = coarse_rows[ring.at + j];
    let own = coarse_value[ring.at + j];
    let left = coarse_held[ring.at + j] - row.x * coarse_value[ring.at + node_before(ring, j, 2u)]
        - row.y * coarse_value[ring.at + node_before(ring, j, 1u)]
        - row.z * coarse_value[ring.at + node_after(ring, j, 1u)]
        - row.w * coarse_value[ring.at + node_after(ring, j, 2u)] - own;
    coarse_value[ring.at + j] = own + sor * left;
}
