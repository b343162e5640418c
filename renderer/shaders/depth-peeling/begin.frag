#version 450
// n(p), and the depths at which peeling begins: the nearest, and from the back the farthest.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "depth-peeling/side.glsl"

uniform int width;
uniform int first_row;

void main() {
#if MIXED
    if (!is_transparent(stored_surface())) return;
#endif
    int p = (int(gl_FragCoord.y) - first_row) * width + int(gl_FragCoord.x);
    uint z = floatBitsToUint(v_depth);
    atomicAdd(count[p], 1u);
    atomicMin(side[SIDES * p].depth, z);
#if SIDES > 1
    atomicMin(side[SIDES * p + 1].depth, ~z);
#endif
}
