// Which of a pixel's SAMPLES samples a fragment covers: as many as its opacity says, chosen by a hash of what the
// fragment is, so that every pass, run and driver agrees.
uniform uint seed;

// PCG-RXS-M-XS-32 (O'Neill 2014) as a hash (Jarzynski and Olano, Hash Functions for GPU Rendering, JCGT 9(3), 2020).
uint pcg(uint x) {
    uint state = x * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28) + 4u)) ^ state) * 277803737u;
    return (word >> 22) ^ word;
}

// Bit i: sample i is covered. z are the bits of the depth, `word` the packed colour.
uint coverage(uint pixel, uint z, uint word) {
    uint random = pcg(pixel ^ pcg(z ^ pcg(word ^ pcg(seed))));
    // floor(a S + xi) samples, in integers: their mean is exactly a S.
    uint left = ((word >> 24) * uint(SAMPLES) + random % 255u) / 255u;
    uint mask = 0u;
    for (uint i = 0u; i < uint(SAMPLES) && left > 0u; ++i) {
        random = pcg(random);
        if (random % (uint(SAMPLES) - i) < left) {  // every subset of that size is equally likely (Knuth, 3.4.2, S)
            mask |= 1u << i;
            --left;
        }
    }
    return mask;
}
