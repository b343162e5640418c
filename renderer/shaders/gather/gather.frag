#version 450
// Order-independent sums over all fragments of a pixel, by additive blending (renderer/features.py: SUMS).
// FULL = 0 gathers only what the density tail needs: n, alpha and the optical depth.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 1) readonly buffer Nearest { uint z_min[]; };
#if FULL
layout(std430, binding = 2) readonly buffer Farthest { uint z_max[]; };
#endif
#if NEAREST
layout(std430, binding = 3) buffer NearestColour { uint nearest_colour[]; };
layout(std430, binding = 4) buffer NearestFacing { uint nearest_facing[]; };
#endif
uniform int width;

layout(location = 0) out vec4 sums0;  // n, sum a, sum a^2, sum -ln(1-a)
#if FULL
layout(location = 1) out vec4 sums1;  // sum rgb, sum x
layout(location = 2) out vec4 sums2;  // sum a rgb, sum x^2
layout(location = 3) out vec4 sums3;  // sum rgb^2
layout(location = 4) out vec4 sums4;  // sum rgb x
#endif

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) discard;
#endif
    float a = float(stored.a) / 255.0;
    sums0 = vec4(1.0, a, a * a, -log(1.0 - a));
    int p = int(gl_FragCoord.y) * width + int(gl_FragCoord.x);
    uint z = floatBitsToUint(v_depth);
#if FULL
    vec3 rgb = vec3(stored.rgb) / 255.0;
    float nearest = uintBitsToFloat(z_min[p]);
    float extent = uintBitsToFloat(z_max[p]) - nearest;
    float x = extent > 0.0 ? (v_depth - nearest) / extent : 0.0;
    sums1 = vec4(rgb, x);
    sums2 = vec4(a * rgb, x * x);
    sums3 = vec4(rgb * rgb, 0.0);
    sums4 = vec4(rgb * x, 0.0);
#endif
#if NEAREST
    if (z == z_min[p]) {  // ties: the smaller packed colour, as in the sorted dump
        atomicMin(nearest_colour[p], pack(stored));
        atomicMax(nearest_facing[p], uint(floor(facing() * 255.0 + 0.5)));
    }
#endif
}
