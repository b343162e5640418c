#version 450
// The bundle's network on every occupied pixel, for the allocation within the frame: what it answers of each bin becomes
// the rank of the bin's price. With OUTPUTS 1 it answers an importance.
layout(local_size_x = 64) in;
#include "allocation/state.glsl"
#include "allocation/bins.glsl"
#include "kbuffer-deep/inputs.glsl"
#include "allocation/prices.glsl"

uniform uint pixels;

#if OUTPUTS == 1
void put_scale(inout Ranks ranks, inout float before, float weight, uint n, int bin) {
    put_rank(ranks, bin, n, 2.0 * log((before + 0.5 * float(n) + 0.5) / weight));
    before += float(n);
}
#else
void put_price(
    inout Ranks ranks, inout float before, DiaphaneAnswer answer, PixelBins bins, uint p, float optical_depth, int bin
) {
    uint n = of_bin(bins, bin);
    float behind = optical_depth * (bin == BINS - 1 ? 1.0 : share_behind(kept_word(p, bin)));
    float prior = prior_gain(max(n, 1u), max(behind - before, 0.0), before, optical_depth);
    put_rank(ranks, bin, n, -(answer.y[bin] + answer.y[BINS] * prior));
    before = behind;
}
#endif

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint p = 64u * group + gl_LocalInvocationIndex;
    if (p >= pixels || complete == 1u) return;
    PixelBins bins = bins_of(p);
    uint fragments = known_fragments(bins);
    if (fragments == 0u) return;
    float x[DIAPHANE_FEATURES];
    read_features(int(p), fragments, x);
    DiaphaneAnswer answer = diaphane_predict(x);
    Ranks ranks;
    ranks.last = 0u;
    for (int i = 0; i < FOURS; ++i) ranks.word[i] = 0u;
#if OUTPUTS == 1
    float weight = answer.y[0] > float(LEAST_IMPORTANCE) ? answer.y[0] : float(LEAST_IMPORTANCE);  // NaN is not
    float before = 0.0;
#define PRICE(bin) put_scale(ranks, before, weight, of_bin(bins, bin), bin);
    EACH_BIN(PRICE)
#else
    float optical_depth = optical_depth_in(p), before = 0.0;
#define PRICE(bin) put_price(ranks, before, answer, bins, p, optical_depth, bin);
    EACH_BIN(PRICE)
#endif
    for (int i = 0; i < FOURS; ++i) bin_word[ranks_at(i, p)] = ranks.word[i];
}
