// What a pixel gets: bins and fragments below the chosen rank, and with what comes at it.
layout(std430, binding = 2) readonly buffer Curves { vec2 curve[]; };  // [P], a and b
uniform uint pixels;

struct Cut {
    uint bins, fragments;            // that are granted
    uint more_bins, more_fragments;  // with those that come at the rank itself
};

Cut cut_of(uint p) {
    Cut cut = Cut(0u, 0u, 0u, 0u);
    if (p >= pixels || known_fragments(p) == 0u) return cut;
    uint before = 0u;
    for (uint bin = 0u; bin < uint(BINS); ++bin) {
        uint own = usable(p, bin, before);
        if (own == uint(FULL)) break;
        if (own == 0u) continue;
        uint found = complete == 1u ? 0u : rank_of(curve[p], before, before + own);
        if (complete == 0u && found > rank) break;
        before += own;
        cut.more_bins = bin + 1u;
        cut.more_fragments = before;
        if (complete == 1u || found < rank) {
            cut.bins = bin + 1u;
            cut.fragments = before;
        }
    }
    return cut;
}
