// Fragments, occupied pixels and the fullest one's fragments of every block.
@group(0) @binding(0) var<storage, read> statistics: array<Statistics>;
@group(0) @binding(1) var<storage, read_write> blocks: array<vec3u>;
var<workgroup> fragments: atomic<u32>;
var<workgroup> filled: atomic<u32>;
var<workgroup> deepest: atomic<u32>;

@compute @workgroup_size(256)
fn total_blocks(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    var own = vec2u(0u);
    var most = 0u;
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (p < arrayLength(&statistics)) {
            let n = usable(statistics[p].n);
            own += vec2u(n, min(n, 1u));
            most = max(most, statistics[p].n);
        }
    }
    atomicAdd(&fragments, own.x);
    atomicAdd(&filled, own.y);
    atomicMax(&deepest, most);
    workgroupBarrier();
    if (lane == 0u) {
        blocks[group.x] = vec3u(atomicLoad(&fragments), atomicLoad(&filled), atomicLoad(&deepest));
    }
}
