// What a pixel gets: bins and fragments below the chosen rank, and with what comes at it.
struct Cut {
    uint bins, fragments;            // that are granted
    uint more_bins, more_fragments;  // with those that come at the rank itself
};

void grant(inout Cut cut, inout uint before, inout bool is_open, uint own, uint found, int bin) {
    is_open = is_open && fits(own, before);
    before += own;
    bool counts = is_open && own > 0u;
    if (counts && (complete == 1u || found <= rank)) {
        cut.more_bins = uint(bin) + 1u;
        cut.more_fragments = before;
    }
    if (counts && (complete == 1u || found < rank)) {
        cut.bins = uint(bin) + 1u;
        cut.fragments = before;
    }
}

Cut cut_of(uint p) {
    Cut cut = Cut(0u, 0u, 0u, 0u);
    PixelBins bins = bins_of(p);
    PixelBins ranks = ranks_of(p);
    uint before = 0u;
    bool is_open = true;
#define GRANT(bin) grant(cut, before, is_open, of_bin(bins, bin), of_bin(ranks, bin), bin);
    EACH_BIN(GRANT)
    return cut;
}

// In one word, for the pass that places it: 5 bits of bins, 10 of fragments, and as many with more.
uint packed_cut(Cut cut) {
    return cut.bins | cut.fragments << 5 | cut.more_bins << 15 | cut.more_fragments << 20;
}

Cut unpacked_cut(uint word) {
    return Cut(word & 31u, word >> 5 & 1023u, word >> 15 & 31u, word >> 20 & 1023u);
}
