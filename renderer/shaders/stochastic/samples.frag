#version 450
// The nearest depth in every sample of a pixel, among the fragments that cover it.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "stochastic/coverage.glsl"

layout(std430, binding = 0) buffer Samples { uint nearest[]; };  // SAMPLES a pixel, of a band of rows
uniform int width;
uniform int first_row;

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) return;
#endif
    uint p = uint(int(gl_FragCoord.y) * width + int(gl_FragCoord.x));
    uint first = (p - uint(first_row * width)) * uint(SAMPLES);
    uint z = floatBitsToUint(v_depth);
    for (uint mask = coverage(p, z, pack(stored)); mask != 0u; mask &= mask - 1u) {
        atomicMin(nearest[first + uint(findLSB(mask))], z);
    }
}
