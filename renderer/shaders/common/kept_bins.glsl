// What is kept of a pixel's depth bins, 16 bits each, and what it says of a fragment. Of bin b: the share of D in front
// of the next bin, in SHARE_LEVELS, times 256, and its mean position, in MEAN_LEVELS; of the last one instead D in units.
// Include common/depth_bins.glsl first.
layout(binding = 3) uniform sampler2D kept_bins[BINS / 4];

struct KeptBins {
    vec4 four[BINS / 4];
};

// All words of a pixel at once: which bin is asked for differs from fragment to fragment, and a texture cannot be chosen
// by that.
KeptBins kept_at(ivec2 xy) {
    KeptBins kept;
    for (int i = 0; i < BINS / 4; ++i) kept.four[i] = texelFetch(kept_bins[i], xy, 0);
    return kept;
}

// By selections: an array indexed by a variable would be memory.
uint word_of(KeptBins kept, int bin) {
    vec4 four = kept.four[0];
#if BINS > 4
    four = bin < 4 ? four : kept.four[1];
#endif
#if BINS > 8
    four = bin < 8 ? four : kept.four[2];
#endif
#if BINS > 12
    four = bin < 12 ? four : kept.four[3];
#endif
    vec2 two = (bin & 2) == 0 ? four.xy : four.zw;
    return uint(((bin & 1) == 0 ? two.x : two.y) * 65535.0 + 0.5);
}

float optical_depth_in(KeptBins kept) {
    return float(uint(kept.four[BINS / 4 - 1].w * 65535.0 + 0.5)) / float(OPTICAL_UNIT);
}

// Of a bin's word: the share of D in front of the next bin.
float share_behind(uint word) {
    return float(word >> 8) / float(SHARE_LEVELS);
}

// Of a bin's word: the mean position of its optical depth in it.
float mean_in(uint word) {
#if MEAN_LEVELS
    return float(word & 255u) / float(MEAN_LEVELS);
#else
    return 0.5;
#endif
}

// Optical depth in front of a fragment: all of the bins before its own, and of its own bin's others as much as lies
// before it if they are spread evenly around their mean.
float in_front(KeptBins kept, float place, float own) {
    int bin = bin_of(place);
    float total = optical_depth_in(kept), s = place - float(bin);
    uint word = word_of(kept, bin);
    bool is_last = bin == BINS - 1;
    float before = bin == 0 ? 0.0 : total * share_behind(word_of(kept, bin - 1));
    float within = (is_last ? total : total * share_behind(word)) - before;
    float others = max(within - own, 0.0);
    float mean = is_last ? 0.5 : mean_in(word), middle = 0.5;
    if (others > float(LEAST_OTHERS)) middle = clamp((within * mean - own * s) / others, 0.0, 1.0);
    float spread = max(min(middle, 1.0 - middle), float(LEAST_SPREAD));
    return before + others * clamp((s - (middle - spread)) / (2.0 * spread), 0.0, 1.0);
}
