// What a pixel with a choice remembers of the last frame: one word, from the lowest bits on. Constants and a plain twin:
// renderer/reference/temporal.py.
//   8  correction of its bins' ranks, around ZERO: of their log gain, PRICE_STEPS a unit
//   8  log gain of each fragment of its last core bin as it was seen, SEEN_STEPS a unit above SEEN_LEAST
//   6  its cut when that was seen; 0: it was not
//   4  frames that have corrected it, at most FRAMES
//   6  its n, at most MOST_KNOWN
// NOTHING: the pixel had no choice.
const uint NOTHING = 0u;
const int ZERO = 128, LARGEST = 127;
const uint MOST_KNOWN = 63u, SEEN_BITS = 0x003FFF00u;

int correction_of(uint word) { return int(word & 255u) - ZERO; }
float seen_gain(uint word) { return float(word >> 8 & 255u) / float(SEEN_STEPS) + float(SEEN_LEAST); }
uint seen_cut(uint word) { return word >> 16 & 63u; }
uint frames_of(uint word) { return word >> 22 & 15u; }
uint known_n(uint word) { return word >> 26; }

// Whether a pixel shows what it showed: its n is that of the last frame, give or take an eighth.
bool is_alike(uint one, uint other) {
    uint more = max(one, other), less = min(one, other);
    return 8u * (more - less) <= more;
}

uint remembered(int correction, uint frames, uint n) {
    return uint(correction + ZERO) | frames << 22 | n << 26;
}
