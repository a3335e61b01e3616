// Coloured sweeps inside V-cycles on the ring. Twin of crates/flow/src/solver/multigrid/mod.rs. The sweeps are in sweeps.wgsl, the
// rings in levels.wgsl, the coarse systems in coarse.wgsl, the transfer between two rings in transfer.wgsl, and the
// cycle in cycle.wgsl.

const SWEEPS_PER_CYCLE = 2u;

/// Sweeps `u` for rhs_x and, if `both`, `v` for rhs_y. Earlier dispatches have made `made` sweeps; this one may make
/// `most` more.
fn solve(both: bool, negligible: real, made: u32, most: u32) -> Solve {
    if both {
        position_terms(k_window);
    } else {
        curvature_terms();
        rhs_y = vec(0.0);
        v = vec(0.0);
    }
    sor = real(1.0);
    let size = system_size(max(bounded_abs(rhs_x), bounded_abs(rhs_y)));
    let tolerance = max(all_parameters[member].tolerance, real(EPSILON) * size);
    var ended = finite_or_not(size);
    build();
    start_sweeps();
    var sweeps = made;
    var left = most;
    while ended == UNSOLVED {
        let error_u = row_of.weight * residual(rhs_x, narrow_window(behind.xy, u, ahead.xy));
        let error_v = row_of.weight * residual(rhs_y, narrow_window(behind.zw, v, ahead.zw));
        let error = max(bounded_abs(error_u), bounded_abs(error_v));
        let increment = max(bounded_abs(u), bounded_abs(v));
        ended = judge(block_max(error), block_max(increment), tolerance, negligible);
        if ended != UNSOLVED || sweeps >= dispatch.max_sweeps || left == 0u { break; }
        share(term_cell * error_u, term_cell * error_v);
        correct();
        // A barrier of the way down separates this from the readers of the residuals.
        behind = pass_up(tails(u, v));
        let batch = min(SWEEPS_PER_CYCLE, dispatch.max_sweeps - sweeps);
        for (var s = 0u; s < batch; s++) { sweep_two(); }
        sweeps += batch;
        left -= min(left, batch);
    }
    return paused_or(ended, sweeps);
}
