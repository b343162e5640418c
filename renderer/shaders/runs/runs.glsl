// The runs of a pool: WORDS words a fragment, those of a pixel next to each other. Words are packed colour, depth bits,
// and with three of them the rank. The offsets were the cursors of the capture, which left each at its run's end.
layout(std430, binding = 0) readonly buffer Ends { uint end_of[]; };  // of the window's pixels
#if WORDS == 2
layout(std430, binding = 1) buffer Pool { uvec2 words[]; };  // one access a fragment
#else
layout(std430, binding = 1) buffer Pool { uint word[]; };
#endif
uniform uint base;  // fragments before this pool

// First fragment of a pixel of the window, and the one after its last.
uvec2 run_of(uint p) {
    return uvec2(p == 0u ? 0u : end_of[p - 1u], end_of[p]) - base;
}

#if WORDS == 3
struct Fragment { uint colour, depth, rank; };

Fragment fragment_at(uint i) {
    return Fragment(word[3u * i], word[3u * i + 1u], word[3u * i + 2u]);
}

void put(uint i, Fragment found) {
    word[3u * i] = found.colour;
    word[3u * i + 1u] = found.depth;
    word[3u * i + 2u] = found.rank;
}

// The order of submission: ranks differ inside a pixel.
bool is_before(Fragment a, Fragment b) {
    return a.rank < b.rank;
}
#else
struct Fragment { uint colour, depth; };

Fragment fragment_at(uint i) {
    return Fragment(words[i].x, words[i].y);
}

void put(uint i, Fragment found) {
    words[i] = uvec2(found.colour, found.depth);
}

// Depth, then packed colour: the order of the sorted dump.
bool is_before(Fragment a, Fragment b) {
    return a.depth < b.depth || a.depth == b.depth && a.colour < b.colour;
}
#endif
