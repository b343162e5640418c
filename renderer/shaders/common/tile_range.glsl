// Where the depth bins of a pixel lie (renderer/tile_range.py): nearest and farthest depth of its tile, float bits.
layout(std430, binding = 7) readonly buffer TileRange { uint tile_range[]; };  // [T, 2]

// Nearest and farthest depth, metres.
vec2 ends_of(ivec2 xy, int width) {
    int tile = xy.y / RANGE_TILE * ((width + RANGE_TILE - 1) / RANGE_TILE) + xy.x / RANGE_TILE;
    return uintBitsToFloat(uvec2(tile_range[2 * tile], tile_range[2 * tile + 1]));
}

// Nearest depth and extent, metres.
vec2 range_of(ivec2 xy, int width) {
    vec2 ends = ends_of(xy, width);
    return vec2(ends.x, ends.y - ends.x);
}
