// The gathered depth bins of every pixel, packed into words (renderer/shaders/gather/pack.comp).
@group(0) @binding(0) var<storage, read> gathered: array<u32>;
@group(0) @binding(1) var<storage, read_write> kept: array<u32>;  // [P][WORDS]

@compute @workgroup_size(64)
fn pack_bins(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = id.y * groups.x * 64u + id.x;
    let at = WORDS * p;
    if (at + WORDS > arrayLength(&kept)) {
        return;
    }
    var front: array<u32, BINS + 1u>;
    for (var b = 0u; b < BINS; b++) {
        front[b + 1u] = front[b] + min(gathered[GATHERED * p + 2u + b], BIN_LIMIT);
    }
    let total = front[BINS];
    kept[at] = bitcast<u32>(f32(gathered[GATHERED * p]) / OPTICAL_ONE);
    for (var w = 0u; w < BINS / 8u; w++) {
        var word = 0u;
        for (var j = 0u; j < 8u; j++) {
            let b = 8u * w + j + 1u;
            if (b == BINS || total == 0u) {
                break;
            }
            word |= ((2u * SHARE_LEVELS * front[b] + total) / (2u * total)) << (4u * j);  // to the nearest step
        }
        kept[at + 1u + w] = word;
    }
}
