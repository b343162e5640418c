#version 450
// The most fragments of a pixel in every tile of TILE x TILE pixels.
layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Counts { uint count[]; };  // [P]
layout(std430, binding = 1) writeonly buffer Tiles { uint most[]; };   // row by row
uniform int width;
uniform int height;

void main() {
    int columns = (width + TILE - 1) / TILE, rows = (height + TILE - 1) / TILE;
    int tile = int(gl_GlobalInvocationID.x);
    if (tile >= columns * rows) return;
    ivec2 first = TILE * ivec2(tile % columns, tile / columns);
    ivec2 end = min(first + TILE, ivec2(width, height));
    uint found = 0u;
    for (int y = first.y; y < end.y; ++y)
        for (int x = first.x; x < end.x; ++x) found = max(found, count[y * width + x]);
    most[tile] = found;
}
