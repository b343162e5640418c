// Where each pixel's run of slots begins if every fragment has one.
@group(0) @binding(0) var<storage, read> n: array<u32>;                 // [P]
@group(0) @binding(1) var<storage, read> sums: array<vec2u>;            // [blocks], before each
@group(0) @binding(2) var<storage, read_write> offsets: array<u32>;     // [P + 1]
const OWN = BLOCK / 256u;
var<workgroup> part: array<u32, 256>;

@compute @workgroup_size(256)
fn place_all(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * BLOCK + lane * OWN;
    var here: array<u32, OWN>;
    var own = 0u;
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&n)) {
            here[i] = min(n[first + i], TURNS);
        }
        own += here[i];
    }
    part[lane] = own;
    for (var reach = 1u; reach < 256u; reach *= 2u) {
        workgroupBarrier();
        var other = 0u;
        if (lane >= reach) {
            other = part[lane - reach];
        }
        workgroupBarrier();
        part[lane] += other;
    }
    var before = sums[group.x].x + part[lane] - own;
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&offsets)) {
            offsets[first + i] = before;
        }
        before += here[i];
    }
}
