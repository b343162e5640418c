// What is kept of a pixel's depth bins, 16 bits each, two a word, and what it says of a fragment. Of bin b: the share of
// D in front of the next bin, in SHARE_LEVELS, times 256, and its mean position, in MEAN_LEVELS; of the last one instead
// D in units. Include common/depth_bins.glsl and common/bin_words.glsl first.

uint kept_word(uint p, int bin) {
    return bin_word[word_at(bin / 2, p)] >> 16 * (bin & 1) & 0xFFFFu;
}

float optical_depth_in(uint p) {
    return float(bin_word[word_at(BINS / 2 - 1, p)] >> 16) / float(OPTICAL_UNIT);
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
float in_front(uint p, float place, float own) {
    int bin = bin_of(place);
    float total = optical_depth_in(p), s = place - float(bin);
    uint word = kept_word(p, bin);
    bool is_last = bin == BINS - 1;
    float before = bin == 0 ? 0.0 : total * share_behind(kept_word(p, bin - 1));
    float within = (is_last ? total : total * share_behind(word)) - before;
    float others = max(within - own, 0.0);
    float mean = is_last ? 0.5 : mean_in(word), middle = 0.5;
    if (others > float(LEAST_OTHERS)) middle = clamp((within * mean - own * s) / others, 0.0, 1.0);
    float spread = max(min(middle, 1.0 - middle), float(LEAST_SPREAD));
    return before + others * clamp((s - (middle - spread)) / (2.0 * spread), 0.0, 1.0);
}
