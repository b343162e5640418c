// A pixel's bins as an allocation sees them. counts: [P, FOURS] words of 8 bits a bin (gather/bins.frag).
layout(std430, binding = 1) buffer Counts { uint counts[]; };
const uint FOURS = uint(BINS) / 4u;

uint count_of(uint p, uint bin) {
    return counts[p * FOURS + bin / 4u] >> 8u * (bin & 3u) & 255u;
}

// Fragments of all bins, as far as they are known.
uint known_fragments(uint p) {
    uint sum = 0u;
    for (uint bin = 0u; bin < uint(BINS); ++bin) sum += count_of(p, bin);
    return sum;
}

// Fragments of a bin that can be in a core behind `before` others; FULL where it cannot, nor can those behind it.
uint usable(uint p, uint bin, uint before) {
    uint own = count_of(p, bin);
    return before + own > uint(MOST_CORE) ? uint(FULL) : own;
}
