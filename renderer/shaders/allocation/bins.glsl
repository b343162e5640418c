// A pixel's packed bins as an allocation sees them.
#include "common/bin_words.glsl"
const int FOURS = BINS / 4;

struct PixelBins {
    uint word[FOURS];
};

PixelBins bins_of(uint p) {
    PixelBins bins;
    for (int i = 0; i < FOURS; ++i) bins.word[i] = bin_word[counts_at(i, p)];
    return bins;
}

uint count_in(PixelBins bins, int bin) {
    return bins.word[bin / 4] >> (8 * (bin & 3)) & 255u;
}

// Fragments of all bins, as far as they are known.
uint known_fragments(PixelBins bins) {
    uint sum = 0u;
    for (int i = 0; i < FOURS; ++i) {
        uint two = (bins.word[i] & 0x00FF00FFu) + (bins.word[i] >> 8 & 0x00FF00FFu);
        sum += (two & 0xFFFFu) + (two >> 16);
    }
    return sum;
}

// Whether a bin of so many fragments can be in a core behind `before` others; those behind it cannot where it cannot.
bool fits(uint own, uint before) {
    return own < uint(FULL) && before + own <= uint(MOST_CORE);
}

// A predicted curve, log gain(k) = a - b (k - 1).
vec2 curve_of(uint p) {
    return uintBitsToFloat(uvec2(bin_word[curve_at(0, p)], bin_word[curve_at(1, p)]));
}

void put_curve(uint p, vec2 curve) {
    bin_word[curve_at(0, p)] = floatBitsToUint(curve.x);
    bin_word[curve_at(1, p)] = floatBitsToUint(curve.y);
}
