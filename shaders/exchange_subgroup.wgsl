// Exchange between the threads of a workgroup that is one subgroup: by shuffles, without barriers. exchange.wgsl has
// the same functions with the same results for workgroups of any size.

@compute @workgroup_size(THREADS)
fn evolve(@builtin(workgroup_id) group: vec3<u32>, @builtin(subgroup_invocation_id) thread: u32) {
    take_block(thread);
    take_member(group.x);
}

/// Shuffles have no readers to wait for.
fn settle() {}

fn windows(a: vec, b: vec) -> Windows {
    return Windows(lone_window(a), lone_window(b));
}

fn lone_window(a: vec) -> Window {
    return window(subgroupShuffle(a, before), a, subgroupShuffle(a, after));
}

fn pass_down(front: vec) -> vec {
    return subgroupShuffle(front, after);
}

fn pass_down_early(front: vec) -> vec {
    return subgroupShuffle(front, after);
}

fn pass_up(tail: vec) -> vec {
    return subgroupShuffle(tail, before);
}

/// Spare threads stay below what others bring.
fn without_spares(part: vec) -> vec {
    return select(vec(-4.0 * BIG), part, owns > 0u);
}

fn ring_maxima(part: vec) -> vec {
    return subgroupMax(without_spares(part));
}

fn ring_summary(sum: vec, extreme: vec, other: vec) -> Summary {
    return Summary(ring_sums(sum), ring_maxima(extreme), ring_maxima(other));
}
