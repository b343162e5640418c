// What is kept of every pixel's gathered depth bins, and the fragments of each, in their place
// (renderer/shaders/gather/pack.comp): of bin b the share of optical depth in front of the next one, times 256, and its mean
// position; of the last one D in units.
@group(0) @binding(0) var<storage, read_write> words: array<u32>;  // [P][BINS]

// `part / whole` in steps of 1 / levels, to the nearest.
fn level(part: u32, whole: u32, levels: u32) -> u32 {
    return select(min((2u * levels * part + whole) / max(2u * whole, 1u), levels), 0u, whole == 0u);
}

@compute @workgroup_size(64)
fn pack_bins(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (BINS * p >= arrayLength(&words)) {
        return;
    }
    var gathered: array<u32, BINS>;
    var total = 0u;
    for (var b = 0u; b < BINS; b++) {
        gathered[b] = words[BINS * p + b];
        total += units_of(gathered[b]);
    }
    if (total == 0u) {
        return;  // all words stay zero
    }
    var front = 0u;
    var low = 0u;
    for (var b = 0u; b < BINS; b++) {
        let own = units_of(gathered[b]);
        front += own;
        var kept = level(front, total, SHARE_LEVELS) << 8u;
        if (MEAN_LEVELS > 0) {
            kept |= level(moment_of(gathered[b]), own, MEAN_LEVELS);
        }
        if (b == BINS - 1u) {
            kept = total;
        }
        if ((b & 1u) == 0u) {
            low = kept;
        } else {
            words[BINS * p + b / 2u] = low | (kept << 16u);
        }
    }
    for (var i = 0u; i < FOURS; i++) {
        var four = 0u;
        for (var j = 0u; j < 4u; j++) {
            four |= fragments_of(gathered[4u * i + j]) << (8u * j);
        }
        words[counts_at(p, i)] = four;
    }
}
