// Fragments, occupied pixels and the fullest one's fragments of every block.
@group(0) @binding(0) var<storage, read> n: array<u32>;                       // [P]
@group(0) @binding(1) var<storage, read_write> blocks: array<vec3u>;
@group(0) @binding(2) var<storage, read_write> sums: array<vec2u>;            // [blocks], fragments and 0
var<workgroup> fragments: atomic<u32>;
var<workgroup> filled: atomic<u32>;
var<workgroup> deepest: atomic<u32>;

@compute @workgroup_size(256)
fn total_blocks(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (p < arrayLength(&n)) {
            atomicAdd(&fragments, min(n[p], TURNS));
            atomicAdd(&filled, min(n[p], 1u));
            atomicMax(&deepest, n[p]);
        }
    }
    workgroupBarrier();
    if (lane == 0u) {
        blocks[group.x] = vec3u(atomicLoad(&fragments), atomicLoad(&filled), atomicLoad(&deepest));
        sums[group.x] = vec2u(atomicLoad(&fragments), 0u);
    }
}
