// At which price each bin is worth its fragments, as ranks (renderer/allocation/prices.py).
// Include allocation/bins.glsl, common/depth_bins.glsl and common/kept_bins.glsl first.

// What the tail tells of the log gain of one bin: n fragments, an optical depth `own` behind `before`; D is the pixel's.
float prior_gain(uint n, float own, float before, float optical_depth) {
    float covered = max(1.0 - exp(-own), float(LEAST_COVERED));
    float gain = 2.0 * (log(covered) - before) - log(float(n));
    float wrong = clamp(optical_depth * (0.5 / float(SHARE_LEVELS)), float(LEAST_ALONE), float(MOST_ALONE));
    if (n == 1u) gain += 2.0 * log(wrong);
    return max(gain, float(LEAST_PRIOR));
}

// A price that is NaN, of a network that overflows, comes last. The bits are asked because a compiler may take it that a
// comparison never meets NaN.
uint rank_of(float price) {
    bool is_nan = (floatBitsToUint(price) & 0x7FFFFFFFu) > 0x7F800000u;
    float steps = (price - float(LEAST_PRICE)) * float(PRICE_STEPS);
    return is_nan ? uint(RANKS) - 1u : uint(clamp(steps + 0.5, 0.0, float(RANKS - 1)));
}

// Bins that are not empty take the places of a rising sequence.
struct Ranks {
    uint word[FOURS];
    uint last;
};

void put_rank(inout Ranks ranks, int bin, uint n, float price) {
    if (n > 0u) ranks.last = max(ranks.last, rank_of(price));
    ranks.word[bin / 4] |= ranks.last << 8 * (bin & 3);
}
