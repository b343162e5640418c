// A pixel's packed bins as an allocation sees them.
#include "common/bin_words.glsl"
const int FOURS = BINS / 4;

// `STEP(bin)` for every bin, in their order, written out: an array that is indexed by a loop's counter lies in memory
// where a driver does not unroll the loop, which costs more than the network.
#define FOUR_STEPS(STEP, bin) STEP(bin) STEP(bin + 1) STEP(bin + 2) STEP(bin + 3)
#if BINS == 8
#define EACH_BIN(STEP) FOUR_STEPS(STEP, 0) FOUR_STEPS(STEP, 4)
#elif BINS == 12
#define EACH_BIN(STEP) FOUR_STEPS(STEP, 0) FOUR_STEPS(STEP, 4) FOUR_STEPS(STEP, 8)
#else
#define EACH_BIN(STEP) FOUR_STEPS(STEP, 0) FOUR_STEPS(STEP, 4) FOUR_STEPS(STEP, 8) FOUR_STEPS(STEP, 12)
#endif

// A number of 8 bits for each.
struct PixelBins {
    uint word[FOURS];
};

PixelBins bins_of(uint p) {
    PixelBins bins;
    for (int i = 0; i < FOURS; ++i) bins.word[i] = bin_word[counts_at(i, p)];
    return bins;
}

uint of_bin(PixelBins bins, int bin) {
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

// A pixel's ranks, four a word (renderer/allocation/prices.py).
PixelBins ranks_of(uint p) {
    PixelBins ranks;
    for (int i = 0; i < FOURS; ++i) ranks.word[i] = bin_word[ranks_at(i, p)];
    return ranks;
}
