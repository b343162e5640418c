// A pixel's words, BINS of them side by side (renderer/shaders/common/bin_words.glsl). `words`, [P][BINS], is declared
// before.
// Gathered: word b is bin b. From the highest bits on: 12 of optical depth in units, 12 of the units times the position in
// the bin, 8 of fragments; each stops at its most, so that sums do not depend on the order.
// Packed: half of the words are what is kept of the bins (kept_bins.wgsl), a quarter the fragments of each, 8 bits a bin,
// and a quarter the rank of each, likewise.
const UNITS_SHIFT = 20u;
const MOMENT_SHIFT = 8u;

fn counts_at(p: u32, four: u32) -> u32 {
    return BINS * p + BINS / 2u + four;
}

fn ranks_at(p: u32, four: u32) -> u32 {
    return BINS * p + BINS / 2u + FOURS + four;
}

fn units_of(word: u32) -> u32 {
    return word >> UNITS_SHIFT;
}

fn moment_of(word: u32) -> u32 {
    return (word >> MOMENT_SHIFT) & BIN_LIMIT;
}

fn fragments_of(word: u32) -> u32 {
    return word & COUNT_LIMIT;
}
