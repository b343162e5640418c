// From the blocks' totals to the view's. One work group.
@group(0) @binding(0) var<storage, read> blocks: array<vec3u>;             // fragments, occupied, deepest
@group(0) @binding(1) var<storage, read_write> counted: array<u32>;        // the same of the view
var<workgroup> part: array<vec3u, 256>;

const CEILING = 0x7fffffffu;  // sums of fragments stop here, above any budget

fn joined(one: vec3u, two: vec3u) -> vec3u {
    return vec3u(min(one.x + two.x, CEILING), one.y + two.y, max(one.z, two.z));
}

@compute @workgroup_size(256)
fn join(@builtin(local_invocation_index) lane: u32) {
    var own = vec3u(0u);
    for (var block = lane; block < arrayLength(&blocks); block += 256u) {
        own = joined(own, blocks[block]);
    }
    part[lane] = own;
    workgroupBarrier();
    if (lane > 0u) {
        return;
    }
    for (var i = 1u; i < 256u; i++) {
        own = joined(own, part[i]);
    }
    counted[0] = own.x;
    counted[1] = own.y;
    counted[2] = own.z;
}
