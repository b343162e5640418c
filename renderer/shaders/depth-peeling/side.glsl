// What peeling knows of a pixel, seen from one side. Fragments have keys (depth, packed colour) that rise along the way:
// from the front the bits as they are, from the back their complement. Of equal keys all are taken at once.
const uint NONE = 0u;          // below every colour's key
const uint OVER = 0xFFFFFFFFu; // above every key; as a depth: nothing is left on this side

struct Side {
    uint depth;        // at which fragments are being taken
    uint taken;        // greatest colour found at this depth
    uint next_depth;   // of this pass: the next depth
    uint next_colour;  // of this pass: the next colour at this depth
};

layout(std430, binding = 0) buffer Sides { Side side[]; };    // SIDES a pixel of a band: front, back
layout(std430, binding = 1) buffer Counts { uint count[]; };  // SIDES a pixel: left << 16 | remaining
// left: fragments at this depth that had the colour `taken` or a greater one
// remaining: of this pass: fragments at this depth with a colour above `taken`

uint remaining_of(uint counts) {
    return counts & 0xFFFFu;
}

// How many fragments of colour `taken` there were, now that those behind it are counted.
uint repeats(Side side, uint counts) {
    return side.taken == NONE ? 0u : (counts >> 16) - remaining_of(counts);
}

// Whether the colour that this pass found belongs to one last fragment at this depth.
bool is_last(uint counts) {
    return remaining_of(counts) == 1u;
}

// Sets up the next pass; whether there is anything left for it.
bool advance(int at) {
    Side old = side[at];
    uint remaining = remaining_of(count[at]);
    if (remaining > 1u) {  // the same depth again, behind the colour that was found
        side[at] = Side(old.depth, old.next_colour, OVER, OVER);
        count[at] = remaining << 16;
        return true;
    }
    side[at] = Side(old.next_depth, NONE, OVER, OVER);
    count[at] = 0u;
    return old.next_depth != OVER;
}
