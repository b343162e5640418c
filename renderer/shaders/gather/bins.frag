#version 450
// One additive pass for a binned tail and what a predictor reads beside it. In order of location: optical depth by bin;
// the same times the position in the bin (MEAN_LEVELS); colours (COLOURS). COUNTS: also fragments by bin, 8 bits each.
// ALONE: nothing but colours, where all do not fit into the targets of one pass.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "common/depth_bins.glsl"
#include "common/tile_range.glsl"

#if COUNTS
layout(std430, binding = 6) coherent buffer Counts { uint count[]; };  // [P, BINS / 4]
#endif
uniform int width;

const int FOURS = BINS / 4;
#if ALONE
#define AFTER_MEANS 0
#else
layout(location = 0) out vec4 bins[FOURS];  // whole units / BIN_LIMIT: sums are exact, whatever their order
#if MEAN_LEVELS
layout(location = FOURS) out vec4 means[FOURS];
#define AFTER_MEANS (2 * FOURS)
#else
#define AFTER_MEANS FOURS
#endif
#endif
#if COLOURS
layout(location = AFTER_MEANS) out vec4 colours;      // sum l rgb, sum l y luma: l optical depth, y place from 0 to 1
layout(location = AFTER_MEANS + 1) out vec4 squares;  // sum l rgb^2, sum l y
#endif

#if COUNTS
// A full count stays full. What others add meanwhile makes the exchange fail, and it is tried again.
void count_in(int p, int bin) {
    uint at = uint(p * FOURS + bin / 4), shift = 8u * uint(bin & 3);
    uint before = count[at];
    while ((before >> shift & 255u) < 255u) {
        uint seen = atomicCompSwap(count[at], before, before + (1u << shift));
        if (seen == before) break;
        before = seen;
    }
}
#endif

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) discard;
#endif
    if (gl_HelperInvocation) return;
    ivec2 xy = ivec2(gl_FragCoord.xy);
    float optical_depth = -log(1.0 - float(stored.a) / 255.0);
    float place = bin_place(v_depth, range_of(xy, width));
    int bin = bin_of(place);
#if !ALONE
    precise float units = optical_units(optical_depth);
    precise float moved = units * (place - float(bin)) + 0.5;
    for (int i = 0; i < FOURS; ++i) {
        vec4 own = vec4(equal(ivec4(0, 1, 2, 3) + 4 * i, ivec4(bin)));
        bins[i] = own * (units / float(BIN_LIMIT));
#if MEAN_LEVELS
        means[i] = own * (floor(moved) / float(BIN_LIMIT));
#endif
    }
#endif
#if COLOURS
    vec3 rgb = vec3(stored.rgb) / 255.0;
    float y = place / float(BINS);
    colours = optical_depth * vec4(rgb, y * dot3(rgb, vec3(LUMA_R, LUMA_G, LUMA_B)));
    squares = optical_depth * vec4(rgb * rgb, y);
#endif
#if COUNTS
    count_in(xy.y * width + xy.x, bin);
#endif
}
