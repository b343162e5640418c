// Fragments that can be in a core.
@group(0) @binding(0) var<storage, read> words: array<u32>;                   // [P][BINS]
@group(0) @binding(1) var<storage, read_write> fragments: array<atomic<u32>>;  // the first member of Cuts
var<workgroup> found: atomic<u32>;

@compute @workgroup_size(256)
fn total_cores(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        var before = 0u;
        for (var bin = 0u; bin < BINS && BINS * p < arrayLength(&words); bin++) {
            let own = usable_in(p, bin, before);
            if (own == FULL) {
                break;
            }
            before += own;
        }
        atomicAdd(&found, before);
    }
    workgroupBarrier();
    if (lane == 0u) {
        atomicAdd(&fragments[0], atomicLoad(&found));
    }
}
