#version 450
// What a binned tail keeps of every pixel's gathered depth bins, and the fragments of each, in their place.
layout(local_size_x = 64) in;
#include "common/bin_words.glsl"
uniform uint pixels;

// `part / whole` in steps of 1 / levels, to the nearest. Integers throughout: a quotient of floats is only where to begin.
uint level(uint part, uint whole, uint levels) {
    if (whole == 0u) return 0u;
    uint dividend = 2u * levels * part + whole, divisor = 2u * whole;
    uint quotient = uint(float(dividend) / float(divisor));
    if (quotient * divisor > dividend) --quotient;
    if ((quotient + 1u) * divisor <= dividend) ++quotient;
    return min(quotient, levels);
}

void main() {
    uint p = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * 64u + gl_LocalInvocationIndex;
    if (p >= pixels) return;
    uint word[BINS], total = 0u, front = 0u;
    for (int b = 0; b < BINS; ++b) {
        word[b] = bin_word[word_at(b, p)];
        total += units_of(word[b]);
    }
    if (total == 0u) return;  // all words stay zero
    uint low = 0u;
    for (int b = 0; b < BINS; ++b) {
        uint own = units_of(word[b]);
        front += own;
        uint kept = b == BINS - 1 ? total : level(front, total, uint(SHARE_LEVELS)) << 8;
#if MEAN_LEVELS
        if (b < BINS - 1) kept |= level(moment_of(word[b]), own, uint(MEAN_LEVELS));
#endif
        if ((b & 1) == 0) low = kept;
        else bin_word[word_at(b / 2, p)] = low | kept << 16;
    }
    for (int i = 0; i < BINS / 4; ++i) {
        uint four = 0u;
        for (int j = 0; j < 4; ++j) four |= count_of(word[4 * i + j]) << 8 * j;
        bin_word[counts_at(i, p)] = four;
    }
}
