// Whether a fragment came before a pool of the frame was full: by triangle, inside of one by pixel.
// FULL: whether it ever was.
#if FULL
#include "arrivals/arrivals.glsl"
layout(std430, binding = 4) readonly buffer Before { uint before[]; };  // pixels of the cut triangle, [P + 1]

bool has_arrived(uint rank, uint p) {
    uint start = first[rank];
    return first[rank + 1u] <= slots || start < slots && before[p] < slots - start;
}
#else
bool has_arrived(uint rank, uint p) {
    return true;
}
#endif
