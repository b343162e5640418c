// Depth bins of the binned density tails (METHOD 2); renderer/depth_bins.py is the compiled twin.
// BINS: 8 or 16; ROOT_SHARE and other constants: schemas/tail.py. A pixel's words: D, float bits; then the shares of D in front of bins 1 to
// BINS - 1, 4 bits each, the nearest lowest.
const uint WORDS = 1u + uint(BINS) / 8u;

// Bin and position in it, in [0, BINS]. Precise, so that every pass finds the same bin.
float bin_place(float z, float nearest, float extent) {
    precise float x = extent > 0.0 ? (z - nearest) / extent : 0.0;
    precise float plain = float(PLAIN_SHARE) * x;
    precise float root = float(ROOT_SHARE) * sqrt(x);
    precise float place = (plain + root) * float(BINS);
    return place;
}
