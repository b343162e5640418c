#version 450
// Every fragment into its depth bin: one word, one atomic exchange (common/bin_words.glsl). LUMA: and one for its colour.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "common/depth_bins.glsl"
#include "common/tile_range.glsl"
#include "common/bin_words.glsl"
uniform int width;

// What is full stays full. What others add meanwhile makes the exchange fail, and it is tried again.
void add_to(uint at, uint units, uint moment) {
    uint before = bin_word[at];
    for (;;) {
        uint sum = min(units_of(before) + units, uint(BIN_LIMIT)) << 20;
        sum |= min(moment_of(before) + moment, uint(BIN_LIMIT)) << 8;
        sum |= min(count_of(before) + 1u, uint(COUNT_LIMIT));
        uint seen = sum == before ? before : atomicCompSwap(bin_word[at], before, sum);
        if (seen == before) return;
        before = seen;
    }
}

#if LUMA
// Whole numbers: what a network reads of colours is the same on every driver, too.
void add_luma(uint at, uint units, uvec3 rgb) {
    uint luma = rgb.r * uint(LUMA_R) + rgb.g * uint(LUMA_G) + rgb.b * uint(LUMA_B) + 128u >> 8;
    uint first = units * luma + (1u << LUMA_SHIFT - 1) >> LUMA_SHIFT;
    uint second = units * luma * luma + (1u << LUMA_SQUARE_SHIFT - 1) >> LUMA_SQUARE_SHIFT;
    uint before = bin_word[at];
    for (;;) {
        uint sum = min((before >> 16) + first, 65535u) << 16 | min((before & 65535u) + second, 65535u);
        uint seen = sum == before ? before : atomicCompSwap(bin_word[at], before, sum);
        if (seen == before) return;
        before = seen;
    }
}
#endif

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) return;
#endif
    if (gl_HelperInvocation) return;
    ivec2 xy = ivec2(gl_FragCoord.xy);
    uint p = uint(xy.y * width + xy.x);
    precise float units = optical_units(-log(1.0 - float(stored.a) / 255.0));
    float place = bin_place(v_depth, range_of(xy, width));
    int bin = bin_of(place);
    precise float moment = units * (place - float(bin)) + 0.5;
    add_to(word_at(bin, p), uint(units), uint(moment));
#if LUMA
    add_luma(luma_at(p), uint(units), stored.rgb);
#endif
}
