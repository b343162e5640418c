#version 450
// Every transparent fragment with its place in the order of submission, into its pixel's run of the pool.
// Drawn with `ranked`; the run's order of arrival means nothing, the sort by rank comes after.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 0) buffer Cursor { uint cursor[]; };
layout(std430, binding = 1) writeonly buffer Pool { uint fragments[]; };  // packed colour, depth bits, rank: 12 bytes
uniform int width;
uniform int first_row;
uniform int first_triangle;

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) return;
#endif
    int p = (int(gl_FragCoord.y) - first_row) * width + int(gl_FragCoord.x);
    uint at = 3u * atomicAdd(cursor[p], 1u);
    fragments[at] = pack(stored);
    fragments[at + 1u] = floatBitsToUint(v_depth);
    fragments[at + 2u] = uint(first_triangle + gl_PrimitiveID);
}
