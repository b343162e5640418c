// The gathered depth bins of every pixel, packed in place (renderer/shaders/gather/pack.comp).
@group(0) @binding(0) var<storage, read_write> gathered: array<u32>;  // [P][GATHERED]

@compute @workgroup_size(64)
fn pack_bins(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    let at = GATHERED * p;
    if (at + GATHERED > arrayLength(&gathered)) {
        return;
    }
    var front: array<u32, BINS + 1u>;
    for (var b = 0u; b < BINS; b++) {
        front[b + 1u] = front[b] + ((gathered[at + 2u + b / 2u] >> (16u * (b & 1u))) & BIN_LIMIT);
    }
    let total = front[BINS];
    gathered[at] = bitcast<u32>(f32(gathered[at]) / OPTICAL_ONE);
    for (var w = 0u; w < BINS / 8u; w++) {
        var word = 0u;
        for (var j = 0u; j < 8u; j++) {
            let b = 8u * w + j + 1u;
            if (b == BINS || total == 0u) {
                break;
            }
            word |= ((2u * SHARE_LEVELS * front[b] + total) / (2u * total)) << (4u * j);  // to the nearest step
        }
        gathered[at + 2u + w] = word;
    }
}
