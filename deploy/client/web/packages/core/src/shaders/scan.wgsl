// Exclusive prefix sums over the blocks, in place. One work group: each thread has a run of them. Sums stop at CEILING,
// so that they are the same in any order.
@group(0) @binding(0) var<storage, read_write> total: array<u32>;   // its last word gets the sum of the first column
@group(0) @binding(1) var<storage, read_write> sums: array<vec2u>;  // [blocks]
var<workgroup> part: array<vec2u, 256>;

const CEILING = vec2u(0x7fffffffu);

@compute @workgroup_size(256)
fn scan(@builtin(local_invocation_index) lane: u32) {
    let blocks = arrayLength(&sums);
    let run = (blocks + 255u) / 256u;
    let first = min(lane * run, blocks);
    let end = min(first + run, blocks);
    var own = vec2u(0u);
    for (var i = first; i < end; i++) {
        own = min(own + sums[i], CEILING);
    }
    part[lane] = own;
    workgroupBarrier();
    if (lane == 0u) {
        var before = vec2u(0u);
        for (var i = 0u; i < 256u; i++) {
            let here = part[i];
            part[i] = before;
            before = min(before + here, CEILING);
        }
        total[arrayLength(&total) - 1u] = before.x;
    }
    workgroupBarrier();
    var before = part[lane];
    for (var i = first; i < end; i++) {
        let here = sums[i];
        sums[i] = before;
        before = min(before + here, CEILING);
    }
}
