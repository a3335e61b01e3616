// Exchange between the threads of a workgroup of any size, through workgroup memory and barriers.
// exchange_subgroup.wgsl has the same functions with the same results for workgroups of one subgroup.

/// Fields that neighbours need, one entry per block.
var<workgroup> ring_a: array<vec, ROWS>;
var<workgroup> ring_b: array<vec, ROWS>;

@compute @workgroup_size(THREADS)
fn evolve(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    take_block(thread);
    take_member(group.x);
}

/// Separates the last readers of the arrays from their next writer, where no other barrier does.
fn settle() {
    workgroupBarrier();
}

/// Writes two fields for all to read.
fn share(a: vec, b: vec) {
    if owns > 0u {
        ring_a[lane] = a;
        ring_b[lane] = b;
    }
    workgroupBarrier();
}

/// The windows of two fields.
fn windows(a: vec, b: vec) -> Windows {
    share(a, b);
    return Windows(window(ring_a[before], a, ring_a[after]), window(ring_b[before], b, ring_b[after]));
}

/// The window of one field.
fn lone_window(a: vec) -> Window {
    if owns > 0u { ring_a[lane] = a; }
    workgroupBarrier();
    return window(ring_a[before], a, ring_a[after]);
}

/// Passes the fronts of the blocks to the blocks before them. One barrier, here and in the next two: each has its own
/// array, so that the barrier of another separates the last readers of an array from its next writer.
fn pass_down(front: vec) -> vec {
    if owns > 0u { ring_a[lane] = front; }
    workgroupBarrier();
    return ring_a[after];
}

/// The same in the middle of a sweep, where blocks of three need the first nodes after them.
fn pass_down_early(front: vec) -> vec {
    if owns > 0u { partials[lane] = front; }
    workgroupBarrier();
    return partials[after];
}

/// Passes the tails of the blocks to the blocks after them.
fn pass_up(tail: vec) -> vec {
    if owns > 0u { ring_b[lane] = tail; }
    workgroupBarrier();
    return ring_b[before];
}

/// Four maxima over the ring from the maxima over each block: first over every `groups`-th block, then over the
/// results, which reads 2 sqrt(BLOCKS) rows instead of BLOCKS.
fn ring_maxima(part: vec) -> vec {
    if owns > 0u { partials[lane] = part; }
    workgroupBarrier();
    var some = part;
    for (var t = group(); t < dispatch.blocks; t += dispatch.groups) {
        some = max(some, partials[t]);
    }
    if owns > 0u { ring_a[lane] = some; }
    workgroupBarrier();
    var largest = some;
    for (var t = 0u; t < dispatch.groups; t++) {
        largest = max(largest, ring_a[t]);
    }
    return largest;
}

/// Four sums in block order and two sets of four maxima over the ring, these by groups like in `ring_maxima`.
fn ring_summary(sum: vec, extreme: vec, other: vec) -> Summary {
    if owns > 0u {
        partials[lane] = sum;
        ring_a[lane] = extreme;
        ring_b[lane] = other;
    }
    workgroupBarrier();
    var all = Summary(sum_of_partials(), extreme, other);
    for (var t = group(); t < dispatch.blocks; t += dispatch.groups) {
        all.extremes = max(all.extremes, ring_a[t]);
        all.others = max(all.others, ring_b[t]);
    }
    settle();
    if owns > 0u {
        ring_a[lane] = all.extremes;
        ring_b[lane] = all.others;
    }
    workgroupBarrier();
    for (var t = 0u; t < dispatch.groups; t++) {
        all.extremes = max(all.extremes, ring_a[t]);
        all.others = max(all.others, ring_b[t]);
    }
    return all;
}
