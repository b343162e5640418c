// Sum of squared differences of two pictures' sRGB bytes, by block: integers, so exact. 2048 pixels fit a word.
@group(0) @binding(0) var<storage, read> one: array<u32>;
@group(0) @binding(1) var<storage, read> two: array<u32>;
@group(0) @binding(2) var<storage, read_write> squares: array<u32>;  // [blocks]
var<workgroup> sum: atomic<u32>;

@compute @workgroup_size(256)
fn add_squares(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    var own = 0u;
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (p < arrayLength(&one)) {
            for (var shift = 0u; shift < 24u; shift += 8u) {
                let apart = i32((one[p] >> shift) & 255u) - i32((two[p] >> shift) & 255u);
                own += u32(apart * apart);
            }
        }
    }
    atomicAdd(&sum, own);
    workgroupBarrier();
    if (lane == 0u) {
        squares[group.x] = atomicLoad(&sum);
    }
}
