#version 450
// n(p), and with RANGE also the depth range of p. Positive floats order as their bits do.
layout(early_fragment_tests) in;  // else fragments behind opaque geometry would count
#include "common/surface.glsl"

layout(std430, binding = 0) buffer Counts { uint count[]; };
#if RANGE
layout(std430, binding = 1) buffer Nearest { uint z_min[]; };
layout(std430, binding = 2) buffer Farthest { uint z_max[]; };
#endif
uniform int width;

void main() {
#if MIXED
    if (!is_transparent(stored_surface())) return;
#endif
    int p = int(gl_FragCoord.y) * width + int(gl_FragCoord.x);
    atomicAdd(count[p], 1u);
#if RANGE
    uint z = floatBitsToUint(v_depth);
    atomicMin(z_min[p], z);
    atomicMax(z_max[p], z);
#endif
}
