#version 450
// An estimate of the depths between which each tile's fragments lie, drawn at a fraction of the resolution: STEPS pixels
// across a tile. A surface that covers the centre of such a pixel is taken to go on as a plane to its edges.
#include "common/surface.glsl"

layout(std430, binding = 0) buffer TileRange { uint tile_range[]; };  // [T, 2], float bits: positive floats order as they do
uniform int width;  // tiles per row

void main() {
#if MIXED
    if (!is_transparent(stored_surface())) return;
#endif
    // Across a silhouette the slope says nothing: no surface falls by a twentieth of its distance within a tile.
    float reach = min(0.5 * (abs(dFdx(v_depth)) + abs(dFdy(v_depth))), 0.05 * v_depth);
    // Where a triangle that reaches behind the eye is interpolated beyond its edges; such bits would be the greatest.
    if (!(v_depth > 0.0)) return;
    int tile = int(gl_FragCoord.y) / STEPS * width + int(gl_FragCoord.x) / STEPS;
    atomicMin(tile_range[2 * tile], floatBitsToUint(v_depth - reach));
    atomicMax(tile_range[2 * tile + 1], floatBitsToUint(v_depth + reach));
}
