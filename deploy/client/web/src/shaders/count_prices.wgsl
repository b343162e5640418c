// Fragments by one half of the rank of the price that they come at: the first half, or once that is chosen the second.
@group(0) @binding(0) var<storage, read> counts: array<u32>;                  // [P][FOURS]
@group(0) @binding(1) var<storage, read> state: Cuts;
@group(0) @binding(2) var<storage, read> curves: array<vec2f>;                // [P], a and b
@group(0) @binding(3) var<storage, read_write> counted: array<atomic<u32>>;   // [HALVES]
var<workgroup> own_counted: array<atomic<u32>, HALVES>;

fn add_events(p: u32, is_low: bool) {
    var before = 0u;
    for (var bin = 0u; bin < BINS; bin++) {
        let own = usable_in(p, bin, before);
        if (own == FULL) {
            break;
        }
        if (own == 0u) {
            continue;
        }
        let found = rank_of(curves[p], before, before + own);
        if (!is_low) {
            atomicAdd(&own_counted[found >> HALF_BITS], own);
        } else if (found >> HALF_BITS == state.high) {
            atomicAdd(&own_counted[found & (HALVES - 1u)], own);
        }
        before += own;
    }
}

fn count_block(group: u32, lane: u32, is_low: bool) {
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group * BLOCK + i * 256u + lane;
        if (p < arrayLength(&curves) && state.complete == 0u) {
            add_events(p, is_low);
        }
    }
    workgroupBarrier();
    for (var i = lane; i < HALVES; i += 256u) {
        let sum = atomicLoad(&own_counted[i]);
        if (sum > 0u) {
            atomicAdd(&counted[i], sum);
        }
    }
}

@compute @workgroup_size(256)
fn count_high(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    count_block(group.x, lane, false);
}

@compute @workgroup_size(256)
fn count_low(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    count_block(group.x, lane, true);
}
