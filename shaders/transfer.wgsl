// Transfer between a ring of multigrid and the next coarser one: residuals down, corrections up. Twin of
// crates/flow/src/solver/multigrid/transfer.rs.

/// The weights between the finer ring and coarse nodes j and j+1.
fn weigh(fine: Level, coarse: Level, j: u32) {
    let before = coarse_value[coarse.at + node_before(coarse, j, 1u)].x;
    let gap = coarse_value[coarse.at + j].x;
    let next = coarse_value[coarse.at + node_after(coarse, j, 1u)].x;
    var way = value_at(fine, fine_node(j)).x;
    let points = select(1u, 2u, has_two_between(fine, j));
    for (var point = 0u; point < points; point++) {
        let weights = lagrange(way, before, gap, next);
        if point == 0u { coarse_weights[coarse.at + j] = weights; } else { odd_weights[odd_place(fine)] = weights; }
        way += value_at(fine, node_between(j)).x;
    }
}

/// Residuals at coarse node j, integrated over its cell.
fn restrict_residuals(fine: Level, coarse: Level, j: u32) -> pair {
    let jmm = node_before(coarse, j, 2u);
    let jm = node_before(coarse, j, 1u);
    let jp = node_after(coarse, j, 1u);
    let near = coarse_weights[coarse.at + jm].z * held_at(fine, node_between(jm))
        + coarse_weights[coarse.at + j].y * held_at(fine, node_between(j));
    let far = coarse_weights[coarse.at + jmm].w * held_at(fine, node_between(jmm))
        + coarse_weights[coarse.at + jp].x * held_at(fine, node_between(jp));
    var sum = held_at(fine, fine_node(j)) + (near + far);
    if is_odd(fine) {
        for (var t = 0u; t < 4u; t++) {
            if around_second(coarse, t) == j { sum = sum + odd_weights[odd_place(fine)][t] * held_at(fine, last_node(fine)); }
        }
    }
    return sum;
}

/// The values of the coarse ring at node i of the finer one.
fn interpolate(fine: Level, coarse: Level, i: u32) -> pair {
    let j = coarse_node(fine, i);
    if is_coarse(fine, i) { return coarse_value[coarse.at + j]; }
    var w = coarse_weights[coarse.at + j];
    if is_second_between(fine, i) { w = odd_weights[odd_place(fine)]; }
    return blend(w, coarse, j);
}

/// The cubic with weights w through coarse nodes j-1 ... j+2.
fn blend(w: vec, ring: Level, j: u32) -> pair {
    let near = w.y * coarse_value[ring.at + j] + w.z * coarse_value[ring.at + node_after(ring, j, 1u)];
    let far = w.x * coarse_value[ring.at + node_before(ring, j, 1u)]
        + w.w * coarse_value[ring.at + node_after(ring, j, 2u)];
    return near + far;
}

/// Weights of coarse nodes j-1 ... j+2 for a point at distance l after node j.
fn lagrange(l: real, before: real, gap: real, after: real) -> vec {
    let r_left = gap - l;
    let far_l = before + l;
    let far_r = r_left + after;
    let wide_l = before + gap;
    let wide_r = gap + after;
    let all_three = wide_l + after;
    return vec(
        -(l * r_left * far_r) / (before * wide_l * all_three),
        far_l * r_left * far_r / (before * gap * wide_r),
        far_l * l * far_r / (wide_l * gap * after),
        -(far_l * l * r_left) / (all_three * wide_r * after),
    );
}
