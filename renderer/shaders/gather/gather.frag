#version 450
// Order-independent sums over all fragments of a pixel, by additive blending (renderer/features.py: SUMS).
// SUMS1 to SUMS4 are the colour attachments of the sums that are wanted besides the first; others are not defined.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 1) readonly buffer Nearest { uint z_min[]; };
#if defined(SUMS1) || defined(SUMS2) || defined(SUMS3) || defined(SUMS4)
#define RELATIVE_DEPTH
layout(std430, binding = 2) readonly buffer Farthest { uint z_max[]; };
#endif
#if NEAREST
layout(std430, binding = 3) buffer NearestColour { uint nearest_colour[]; };
layout(std430, binding = 4) buffer NearestFacing { uint nearest_facing[]; };
#endif
uniform int width;

layout(location = 0) out vec4 sums0;  // n, sum a, sum a^2, sum -ln(1-a)
#ifdef SUMS1
layout(location = SUMS1) out vec4 sums1;  // sum rgb, sum x
#endif
#ifdef SUMS2
layout(location = SUMS2) out vec4 sums2;  // sum a rgb, sum x^2
#endif
#ifdef SUMS3
layout(location = SUMS3) out vec4 sums3;  // sum rgb^2
#endif
#ifdef SUMS4
layout(location = SUMS4) out vec4 sums4;  // sum rgb x
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
#ifdef RELATIVE_DEPTH
    vec3 rgb = vec3(stored.rgb) / 255.0;
    float nearest = uintBitsToFloat(z_min[p]);
    float extent = uintBitsToFloat(z_max[p]) - nearest;
    float x = extent > 0.0 ? (v_depth - nearest) / extent : 0.0;
#endif
#ifdef SUMS1
    sums1 = vec4(rgb, x);
#endif
#ifdef SUMS2
    sums2 = vec4(a * rgb, x * x);
#endif
#ifdef SUMS3
    sums3 = vec4(rgb * rgb, 0.0);
#endif
#ifdef SUMS4
    sums4 = vec4(rgb * x, 0.0);
#endif
#if NEAREST
    if (z == z_min[p]) {  // ties: the smaller packed colour, as in the sorted dump
        atomicMin(nearest_colour[p], pack(stored));
        atomicMax(nearest_facing[p], uint(floor(facing() * 255.0 + 0.5)));
    }
#endif
}
