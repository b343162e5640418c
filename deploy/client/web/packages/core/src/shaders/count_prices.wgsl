// Fragments by the rank of the price that they come at.
@group(0) @binding(0) var<storage, read> words: array<u32>;                   // [P][BINS]
@group(0) @binding(1) var<storage, read> state: Cuts;
@group(0) @binding(2) var<storage, read_write> counted: array<atomic<u32>>;   // [RANKS]
var<workgroup> own_counted: array<atomic<u32>, RANKS>;

fn add_events(p: u32) {
    var before = 0u;
    for (var bin = 0u; bin < BINS; bin++) {
        let own = usable_in(p, bin, before);
        if (own == FULL) {
            break;
        }
        if (own == 0u) {
            continue;
        }
        atomicAdd(&own_counted[rank_in(p, bin)], own);
        before += own;
    }
}

@compute @workgroup_size(256)
fn count_prices(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (BINS * p < arrayLength(&words) && state.complete == 0u) {
            add_events(p);
        }
    }
    workgroupBarrier();
    for (var i = lane; i < RANKS; i += 256u) {
        let sum = atomicLoad(&own_counted[i]);
        if (sum > 0u) {
            atomicAdd(&counted[i], sum);
        }
    }
}
