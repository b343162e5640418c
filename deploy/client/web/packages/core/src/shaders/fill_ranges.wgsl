// Tiles whose centre no surface covers get the range of those around them, else that of the whole view
// (renderer/shaders/range/fill.comp). One work group.
@group(0) @binding(0) var<storage, read> found: array<vec2u>;            // [T], ~ nearest, farthest, float bits
@group(0) @binding(1) var<storage, read_write> ranges: array<vec2f>;     // [T], nearest and extent, metres
@group(0) @binding(2) var<uniform> grid: vec2u;                          // columns, rows
var<workgroup> part: array<vec2u, 256>;

fn around(tile: u32) -> vec2u {
    let at = vec2i(vec2u(tile % grid.x, tile / grid.x));
    var range = vec2u(0u);
    for (var y = max(at.y - 1, 0); y <= min(at.y + 1, i32(grid.y) - 1); y++) {
        for (var x = max(at.x - 1, 0); x <= min(at.x + 1, i32(grid.x) - 1); x++) {
            range = max(range, found[u32(y) * grid.x + u32(x)]);
        }
    }
    return range;
}

@compute @workgroup_size(256)
fn fill_ranges(@builtin(local_invocation_index) lane: u32) {
    let tiles = grid.x * grid.y;
    var whole = vec2u(0u);
    for (var tile = lane; tile < tiles; tile += 256u) {
        whole = max(whole, found[tile]);
    }
    part[lane] = whole;
    workgroupBarrier();
    for (var i = 0u; i < 256u; i++) {
        whole = max(whole, part[i]);
    }
    for (var tile = lane; tile < tiles; tile += 256u) {
        var range = found[tile];
        if (range.y == 0u) {
            range = around(tile);
        }
        if (range.y == 0u) {
            range = whole;
        }
        var ends = vec2f(0.0);
        if (range.y > 0u) {
            ends = bitcast<vec2f>(vec2u(~range.x, range.y));
        }
        ranges[tile] = vec2f(ends.x, ends.y - ends.x);
    }
}
