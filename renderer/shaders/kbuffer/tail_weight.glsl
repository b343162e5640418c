// What a fragment of the tail weighs in its sums (METHOD 2). TAIL: 0 exact-coverage, 1 density, 2 weighted-average, 3 paper, 4 binned density.
#if TAIL == 1 || TAIL == 4
layout(std430, binding = 3) readonly buffer Nearest { uint z_min[]; };
layout(std430, binding = 4) readonly buffer Farthest { uint z_max[]; };
#endif
#if TAIL == 1
layout(binding = 0) uniform sampler2D gathered;  // n, sum a, sum a^2, optical depth D
uniform float density_g;
#elif TAIL == 4
#include "common/depth_bins.glsl"
layout(std430, binding = 5) readonly buffer DepthBins { uint kept[]; };  // [P, WORDS]
#endif

#if TAIL == 4
// Share of D in front of a bin.
float share_in_front(uint at, int bin) {
    if (bin == 0) return 0.0;
    if (bin == BINS) return 1.0;
    uint word = kept[at + 1u + uint(bin - 1) / 8u];
    return float(word >> (4u * (uint(bin - 1) & 7u)) & 15u) / float(SHARE_LEVELS);
}

// Optical depth in front of a fragment: all of the bins before its own, and of its own bin's others, taken as evenly spread.
float in_front(int p, float z, float nearest, float extent, float own) {
    uint at = WORDS * uint(p);
    float total = uintBitsToFloat(kept[at]);
    float place = bin_place(z, nearest, extent);
    int bin = min(int(place), BINS - 1);
    float before = total * share_in_front(at, bin);
    float others = total * share_in_front(at, bin + 1) - before - own;
    return before + max(others, 0.0) * (place - float(bin));
}
#endif

// Its alpha, and with a density tail how much of it is taken to be seen.
float tail_weight(int p, float a, float z) {
    float weight = a;
#if TAIL == 1 || TAIL == 4
    float nearest = uintBitsToFloat(z_min[p]);
    float extent = uintBitsToFloat(z_max[p]) - nearest;
#endif
#if TAIL == 1
    float x = extent > 0.0 ? (z - nearest) / extent : 0.0;
    float optical_depth = texelFetch(gathered, ivec2(gl_FragCoord.xy), 0).w;
    weight *= exp(-min(density_g * optical_depth * x, MAX_EXPONENT));
#elif TAIL == 4
    weight *= exp(-min(in_front(p, z, nearest, extent, -log(1.0 - a)), MAX_EXPONENT));
#endif
    return weight;
}
