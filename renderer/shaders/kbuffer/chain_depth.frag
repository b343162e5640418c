#version 450
// First pass of the two-pass chain: the k(p) smallest depths, lock-free and in any order of arrival.
// Each slot keeps the minimum of what passes it and hands the larger value on, so slot i ends as the i-th smallest.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 0) readonly buffer Offsets { uint offset[]; };  // [P+1]
layout(std430, binding = 1) coherent buffer Depths { uint depth[]; };
uniform int width;

const uint EMPTY = 0xFFFFFFFFu;

void main() {
#if MIXED
    if (!is_transparent(stored_surface())) return;
#endif
    if (gl_HelperInvocation) return;  // beyond the window's edge there are no offsets, and loops would go anywhere
    int p = int(gl_FragCoord.y) * width + int(gl_FragCoord.x);
    uint end = offset[p + 1];
    uint z = floatBitsToUint(v_depth);
    for (uint i = offset[p]; i < end; ++i) {
        // A slot only ever falls, so a value read here that is not above z stays so: the atomic would change nothing.
        if (depth[i] <= z) continue;
        uint before = atomicMin(depth[i], z);
        if (before == EMPTY) break;
        z = max(z, before);
    }
}
