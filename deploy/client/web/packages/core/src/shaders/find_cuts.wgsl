// What every pixel gets below the chosen rank, and with what comes at it.
@group(0) @binding(0) var<storage, read> words: array<u32>;               // [P][BINS]
@group(0) @binding(1) var<storage, read> state: Cuts;
@group(0) @binding(2) var<storage, read_write> cuts: array<u32>;          // [P], 5, 10, 5 and 10 bits
@group(0) @binding(3) var<storage, read_write> sums: array<vec2u>;        // [blocks], granted and growth
var<workgroup> sure: atomic<u32>;
var<workgroup> growth: atomic<u32>;

// Bins and fragments that are granted, and the same with those that come at the rank itself.
fn cut_of(p: u32) -> vec4u {
    var cut = vec4u(0u);
    var before = 0u;
    for (var bin = 0u; bin < BINS; bin++) {
        let own = usable_in(p, bin, before);
        if (own == FULL) {
            break;
        }
        if (own == 0u) {
            continue;
        }
        var found = 0u;
        if (state.complete == 0u) {
            found = rank_in(p, bin);
            if (found > state.rank) {
                break;
            }
        }
        before += own;
        cut.z = bin + 1u;
        cut.w = before;
        if (state.complete == 1u || found < state.rank) {
            cut.x = cut.z;
            cut.y = before;
        }
    }
    return cut;
}

@compute @workgroup_size(256)
fn find_cuts(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (p < arrayLength(&cuts)) {
            let cut = cut_of(p);
            cuts[p] = cut.x | (cut.y << 5u) | (cut.z << 15u) | (cut.w << 20u);
            atomicAdd(&sure, cut.y);
            atomicAdd(&growth, cut.w - cut.y);
        }
    }
    workgroupBarrier();
    if (lane == 0u) {
        sums[group.x] = vec2u(atomicLoad(&sure), atomicLoad(&growth));
    }
}
