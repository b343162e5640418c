// An estimate of the depths between which each tile's fragments lie, at a quarter of the resolution: STEPS pixels across
// a tile (renderer/shaders/range/range.frag). The near ends are kept inverted, so that cleared buffers begin at zero.
@group(2) @binding(0) var<storage, read_write> found: array<atomic<u32>>;  // [T][2]
const STEPS = 2u;

@fragment
fn find_range(in: Surface) {
    let stored = stored_surface(in);
    let depth = 1.0 / in.position.w;
    let slope = abs(dpdxFine(depth)) + abs(dpdyFine(depth));
    if (!is_transparent(stored)) {
        return;
    }
    // Across a silhouette the slope says nothing: no surface falls by a twentieth of its distance within a tile.
    let reach = min(0.5 * slope, 0.05 * depth);
    // Where a triangle that reaches behind the eye is interpolated beyond its edges; such bits would be the greatest.
    if (!(depth > 0.0)) {
        return;
    }
    let columns = (camera.size.x + RANGE_TILE - 1) / RANGE_TILE;
    let tile = u32(in.position.y) / STEPS * columns + u32(in.position.x) / STEPS;
    atomicMax(&found[2u * tile], ~bitcast<u32>(depth - reach));
    atomicMax(&found[2u * tile + 1u], bitcast<u32>(depth + reach));
}
