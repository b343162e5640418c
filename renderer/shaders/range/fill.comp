#version 450
// Tiles whose centre no surface covers get the range of those around them, else that of the whole view.
layout(local_size_x = 256) in;

layout(std430, binding = 0) readonly buffer Found { uvec2 found[]; };       // [T], nearest, farthest, float bits
layout(std430, binding = 1) writeonly buffer TileRange { uvec2 ranges[]; };  // [T]
uniform int columns;
uniform int rows;
const uvec2 NONE = uvec2(0xFFFFFFFFu, 0u);
shared uvec2 part[256];

uvec2 joined(uvec2 one, uvec2 two) {
    return uvec2(min(one.x, two.x), max(one.y, two.y));
}

uvec2 around(int tile) {
    ivec2 at = ivec2(tile % columns, tile / columns);
    uvec2 range = NONE;
    for (int y = max(at.y - 1, 0); y <= min(at.y + 1, rows - 1); ++y)
        for (int x = max(at.x - 1, 0); x <= min(at.x + 1, columns - 1); ++x) range = joined(range, found[y * columns + x]);
    return range;
}

void main() {
    int lane = int(gl_LocalInvocationIndex), tiles = columns * rows;
    uvec2 whole = NONE;
    for (int tile = lane; tile < tiles; tile += 256) whole = joined(whole, found[tile]);
    part[lane] = whole;
    barrier();
    for (int i = 0; i < 256; ++i) whole = joined(whole, part[i]);
    if (whole == NONE) whole = uvec2(0u);
    for (int tile = lane; tile < tiles; tile += 256) {
        uvec2 range = found[tile];
        if (range == NONE) range = around(tile);
        ranges[tile] = range == NONE ? whole : range;
    }
}
