// Depth bins of the binned tails (METHOD 2); renderer/depth_bins.py is the compiled twin.
// BINS, SHARE_LEVELS, MEAN_LEVELS and constants: a row of schemas/tail.py.

// Bin and position in it, in [0, BINS]; range is nearest depth and extent. Precise, so that every pass finds the same bin.
float bin_place(float z, vec2 range) {
    precise float x = range.y > 0.0 ? (z - range.x) / range.y : 0.0;
    x = clamp(x, 0.0, 1.0);
    precise float plain = float(PLAIN_SHARE) * x;
    precise float root = float(ROOT_SHARE) * sqrt(x);
    precise float place = (plain + root) * float(BINS);
    return place;
}

int bin_of(float place) {
    return min(int(place), BINS - 1);
}

// Optical depth in the whole units that bins count in.
float optical_units(float optical_depth) {
    return optical_depth > 0.0 ? max(1.0, floor(optical_depth * float(OPTICAL_UNIT) + 0.5)) : 0.0;
}
