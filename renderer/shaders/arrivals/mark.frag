#version 450
// The pixels of the triangle with whose fragments the pool becomes full; drawn with `ranked`.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "arrivals/arrivals.glsl"

layout(std430, binding = 4) writeonly buffer Mark { uint mark[]; };  // of the window's pixels
uniform int first_triangle;
uniform int width;

void main() {
#if MIXED
    if (!is_transparent(stored_surface())) return;
#endif
    uint rank = uint(first_triangle + gl_PrimitiveID);
    if (first[rank] < slots && first[rank + 1u] > slots) mark[int(gl_FragCoord.y) * width + int(gl_FragCoord.x)] = 1u;
}
