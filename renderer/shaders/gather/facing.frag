#version 450
// How much the nearest fragment faces the eye: what VKB reads of a pixel.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 1) readonly buffer Nearest { uint z_min[]; };
layout(std430, binding = 3) buffer NearestFacing { uint nearest_facing[]; };
uniform int width;

void main() {
#if MIXED
    if (!is_transparent(stored_surface())) return;
#endif
    int p = int(gl_FragCoord.y) * width + int(gl_FragCoord.x);
    if (floatBitsToUint(v_depth) == z_min[p]) atomicMax(nearest_facing[p], uint(floor(facing() * 255.0 + 0.5)));
}
