// A pixel's words, PIXEL_WORDS of them side by side (renderer/bin_pass.py).
// Gathered: word b is bin b. From the highest bits on: 12 of optical depth in units, 12 of the units times the position in
// the bin, 8 of fragments; each stops at its most, so that sums do not depend on the order.
// With LUMA, word BINS is of colours: 16 bits of units times luma, and 16 of units times its square (schemas/tail.py).
// Packed: half of the words are what is kept of the bins (kept_bins.glsl), a quarter the fragments of each, 8 bits a bin,
// and a quarter the rank of each, likewise; of these the first is then the cut that they lead to.
// Placed: behind what is kept, where the pixel's run of the pool begins; and from the highest bits on, 5 of its cut, the
// bins in its core, and 27 of a cursor, which stops at the run's end. The other words are free for the pool (pool.glsl).
layout(std430, binding = 5) buffer Words { uint bin_word[]; };  // [P, PIXEL_WORDS]

const uint CURSOR_BITS = 27u, CURSOR_MASK = (1u << CURSOR_BITS) - 1u;

uint word_at(int word, uint p) {
    return uint(PIXEL_WORDS) * p + uint(word);
}

uint luma_at(uint p) { return word_at(BINS, p); }
uint counts_at(int four, uint p) { return word_at(BINS / 2 + four, p); }
uint ranks_at(int four, uint p) { return word_at(BINS / 2 + BINS / 4 + four, p); }
uint cut_at(uint p) { return ranks_at(0, p); }
uint begin_at(uint p) { return word_at(BINS / 2, p); }
uint core_at(uint p) { return word_at(BINS / 2 + 1, p); }

uint units_of(uint word) { return word >> 20; }
uint moment_of(uint word) { return word >> 8 & uint(BIN_LIMIT); }
uint count_of(uint word) { return word & uint(COUNT_LIMIT); }

// A pixel's run of the pool, once all is captured.
uint run_begin(uint p) { return bin_word[begin_at(p)]; }
uint run_end(uint p) { return bin_word[core_at(p)] & CURSOR_MASK; }
