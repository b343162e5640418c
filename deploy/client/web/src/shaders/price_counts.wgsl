// Fragments of the pixels of every block at every edge.
@group(0) @binding(0) var<storage, read> state: State;
@group(0) @binding(1) var<storage, read> statistics: array<Statistics>;
@group(0) @binding(2) var<storage, read> curves: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;  // [blocks][EDGES]
const OWN = BLOCK / 128u;
var<workgroup> at: array<f32, EDGES>;
var<workgroup> bin: array<atomic<u32>, EDGES>;

@compute @workgroup_size(128)
fn count_prices(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    if (is_found(state.low, state.high)) {
        return;
    }
    if (lane < u32(EDGES)) {
        at[lane] = price(state.edge[lane]);
    }
    var own: array<vec2f, OWN>;
    var most: array<u32, OWN>;  // 0: it has none at any price
    for (var i = 0u; i < OWN; i++) {
        let p = group.x * BLOCK + i * 128u + lane;
        if (p < arrayLength(&statistics)) {
            let n = usable(statistics[p].n);
            if (n > 0u && state.complete == 0u) {
                own[i] = curves[p];
                most[i] = n;
            }
        }
    }
    workgroupBarrier();
    for (var j = 0u; j < u32(EDGES); j++) {
        let here = (j + lane) % u32(EDGES);  // neighbours add to different bins
        var sum = 0u;
        for (var i = 0u; i < OWN; i++) {
            sum += fragments_at(at[here], own[i], most[i]);
        }
        atomicAdd(&bin[here], sum);
    }
    workgroupBarrier();
    if (lane < u32(EDGES)) {
        counts[group.x * u32(EDGES) + lane] = atomicLoad(&bin[lane]);
    }
}
