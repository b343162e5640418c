// What peeling knows of a pixel, seen from one side. Fragments have keys (depth, packed colour) that rise along the way:
// from the front the bits as they are, from the back their complement. Of equal keys all are taken at once.
const uint NONE = 0u;          // below every colour's key
const uint OVER = 0xFFFFFFFFu; // above every key; as a depth: nothing is left on this side

struct Side {
    uint depth;        // at which fragments are being taken
    uint taken;        // greatest colour found at this depth
    uint left;         // fragments at this depth that had this colour or a greater one
    uint next_depth;   // of this pass: the next depth
    uint next_colour;  // of this pass: the next colour at this depth
    uint remaining;    // of this pass: fragments at this depth with a colour above `taken`
};

Side fresh(uint depth) {
    return Side(depth, NONE, 0u, OVER, OVER, 0u);
}

// How many fragments of colour `taken` there were, now that those behind it are counted.
uint repeats(Side side) {
    return side.taken == NONE ? 0u : side.left - side.remaining;
}

// Whether the colour that this pass found belongs to one last fragment at this depth.
bool is_last(Side side) {
    return side.remaining == 1u;
}

bool has_more(Side side) {
    return side.remaining > 1u;
}

// The same depth again, behind the colour that was found.
Side behind_found(Side side) {
    return Side(side.depth, side.next_colour, side.remaining, OVER, OVER, 0u);
}
