// What is kept of every pixel's gathered depth bins, in their place (renderer/shaders/gather/pack.comp): of bin b the
// share of optical depth in front of the next one, times 256, and its mean position; of the last one D in units.
@group(0) @binding(0) var<storage, read_write> bins: array<u32>;  // [P][BINS]

fn level(part: u32, whole: u32, levels: u32) -> u32 {
    return select(min((2u * levels * part + whole) / max(2u * whole, 1u), levels), 0u, whole == 0u);
}

@compute @workgroup_size(64)
fn pack_bins(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let at = BINS * thread_of(id, groups);
    if (at + BINS > arrayLength(&bins)) {
        return;
    }
    var total = 0u;
    for (var b = 0u; b < BINS; b++) {
        total += bins[at + b] >> 16u;
    }
    var front = 0u;
    for (var b = 0u; b < BINS; b++) {
        let own = bins[at + b] >> 16u;
        front += own;
        var word = level(front, total, SHARE_LEVELS) << 8u;
        if (MEAN_LEVELS > 0) {
            word |= level(bins[at + b] & BIN_LIMIT, own, MEAN_LEVELS);
        }
        bins[at + b] = select(word, min(total, BIN_LIMIT), b == BINS - 1u);
    }
}
