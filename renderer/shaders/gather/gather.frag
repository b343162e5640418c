#version 450
// Order-independent sums over all fragments of a pixel, by additive blending (renderer/features.py: SUMS).
// SUMS0 to SUMS4 are the colour attachments of the sums that are wanted; others are not defined. With BINS there are none:
// the first is that of the optical depth, and those that follow are the depth bins'.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 1) readonly buffer Nearest { uint z_min[]; };
#if defined(SUMS1) || defined(SUMS2) || defined(SUMS3) || defined(SUMS4)
#define RELATIVE_DEPTH
#endif
#if defined(RELATIVE_DEPTH) || BINS
layout(std430, binding = 2) readonly buffer Farthest { uint z_max[]; };
#endif
#if NEAREST
layout(std430, binding = 3) buffer NearestColour { uint nearest_colour[]; };
#if NEAREST == 2
layout(std430, binding = 4) buffer NearestFacing { uint nearest_facing[]; };
#endif
#endif
uniform int width;

#if BINS
#include "common/depth_bins.glsl"
layout(location = 0) out float binned_depth;   // sum -ln(1-a)
layout(location = 1) out vec4 bins[BINS / 4];  // the same by bin, in whole units / BIN_LIMIT
#endif
#ifdef SUMS0
layout(location = SUMS0) out vec4 sums0;  // n, sum a, sum a^2, sum -ln(1-a)
#endif
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
    float optical_depth = -log(1.0 - a);
#ifdef SUMS0
    sums0 = vec4(1.0, a, a * a, optical_depth);
#endif
    int p = int(gl_FragCoord.y) * width + int(gl_FragCoord.x);
    uint z = floatBitsToUint(v_depth);
#if defined(RELATIVE_DEPTH) || BINS
    float nearest = uintBitsToFloat(z_min[p]);
    float extent = uintBitsToFloat(z_max[p]) - nearest;
#endif
#if BINS
    int bin = min(int(bin_place(v_depth, nearest, extent)), BINS - 1);
    float units = a > 0.0 ? max(1.0, floor(optical_depth * float(OPTICAL_UNIT) + 0.5)) / float(BIN_LIMIT) : 0.0;
    for (int i = 0; i < BINS / 4; ++i) bins[i] = units * vec4(equal(ivec4(0, 1, 2, 3) + 4 * i, ivec4(bin)));
    binned_depth = optical_depth;
#endif
#ifdef RELATIVE_DEPTH
    vec3 rgb = vec3(stored.rgb) / 255.0;
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
#if NEAREST == 2
        atomicMax(nearest_facing[p], uint(floor(facing() * 255.0 + 0.5)));
#endif
    }
#endif
}
