// What a pixel gets: bins and fragments below the chosen rank, and with what comes at it.
struct Cut {
    uint bins, fragments;            // that are granted
    uint more_bins, more_fragments;  // with those that come at the rank itself
};

Cut cut_of(uint p) {
    Cut cut = Cut(0u, 0u, 0u, 0u);
    PixelBins bins = bins_of(p);
    PixelBins ranks = ranks_of(p);
    uint before = 0u;
    bool is_open = true;
    for (int bin = 0; bin < BINS; ++bin) {
        uint own = of_bin(bins, bin);
        is_open = is_open && fits(own, before);
        uint found = of_bin(ranks, bin);
        before += own;
        if (!is_open || own == 0u) continue;
        if (complete == 1u || found <= rank) {
            cut.more_bins = uint(bin) + 1u;
            cut.more_fragments = before;
        }
        if (complete == 1u || found < rank) {
            cut.bins = uint(bin) + 1u;
            cut.fragments = before;
        }
    }
    return cut;
}

// In one word, for the pass that places it: 5 bits of bins, 10 of fragments, and as many with more.
uint packed_cut(Cut cut) {
    return cut.bins | cut.fragments << 5 | cut.more_bins << 15 | cut.more_fragments << 20;
}

Cut unpacked_cut(uint word) {
    return Cut(word & 31u, word >> 5 & 1023u, word >> 15 & 31u, word >> 20 & 1023u);
}
