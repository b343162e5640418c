// What a fragment of the tail weighs in its sums (METHOD 2). TAIL: a kind of schemas/tail.py.
#if TAIL == TAIL_DENSITY
layout(std430, binding = 3) readonly buffer Nearest { uint z_min[]; };
layout(std430, binding = 4) readonly buffer Farthest { uint z_max[]; };
uniform sampler2D gathered;  // n, sum a, sum a^2, optical depth D
uniform float density_g;
#elif TAIL == TAIL_BINNED
#include "common/depth_bins.glsl"
#include "common/bin_words.glsl"
#include "common/kept_bins.glsl"
#include "common/tile_range.glsl"
#endif

// Its alpha, and with a density tail how much of it is taken to be seen.
float tail_weight(int p, float a, float z) {
    float weight = a;
#if TAIL == TAIL_DENSITY
    float nearest = uintBitsToFloat(z_min[p]);
    float extent = uintBitsToFloat(z_max[p]) - nearest;
    float x = extent > 0.0 ? (z - nearest) / extent : 0.0;
    float optical_depth = texelFetch(gathered, ivec2(gl_FragCoord.xy), 0).w;
    weight *= exp(-min(density_g * optical_depth * x, MAX_EXPONENT));
#elif TAIL == TAIL_BINNED
    float place = bin_place(z, range_of(ivec2(gl_FragCoord.xy), width));
    weight *= exp(-min(in_front(uint(p), place, -log(1.0 - a)), MAX_EXPONENT));
#endif
    return weight;
}
