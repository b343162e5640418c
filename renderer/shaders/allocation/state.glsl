// What the passes of an allocation tell each other (renderer/allocation/gpu.py: STATE); `warm` and `low` stay for the
// next frame.
layout(std430, binding = 0) buffer State {
    uint complete;     // 1 where the budget covers every fragment: nothing is predicted or solved
    uint open_pixels;  // pixels with fragments, unless it does
    uint budget;       // fragments to spend
    uint low_sum;      // what is spent at `low`
    uint listed;       // cursor of the list
    uint rounds;       // that counted
    uint warm;         // 1: `low` is the answer of an earlier frame
    int low;           // greatest index of a price known to be within the budget
    int high;          // an index above `low` that is beyond it, or LAST
    uint count_groups[3];
    int edge[EDGES];   // indices of the prices that the next round counts at
};
const uint CEILING = 0x7FFFFFFFu;  // sums stop here, above any budget

// Sums that stop at CEILING are the same in any order.
uint add(uint one, uint two) {
    return min(one + two, CEILING);
}
uvec2 add(uvec2 one, uvec2 two) {
    return min(one + two, uvec2(CEILING));
}

// A pixel's fragments that can have a slot: no more than one shader can visit.
uint usable(uint n) {
    return min(n, TURNS);
}

// Edge j of a round between two indices, evenly spread.
int edge_between(int from, int to, int j) {
    int apart = (to - from + EDGES) / (EDGES + 1);
    return min(from + apart * (j + 1), to);
}
