#version 450
// Fragments by one half of the rank of the price that they come at; with LOW the second half, of those whose first is
// the one that was chosen.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"
#include "allocation/bins.glsl"
#include "allocation/rank.glsl"

layout(std430, binding = 2) readonly buffer Curves { vec2 curve[]; };  // [P], a and b
uniform uint pixels;
const uint SIZE = 1u << HALF_BITS;
shared uint own_counted[SIZE];

void add_events(uint p) {
    PixelBins bins = bins_of(p);
    vec2 gain = curve[p];
    uint before = 0u;
    bool is_open = true;
    for (int bin = 0; bin < BINS; ++bin) {
        uint own = count_in(bins, bin);
        is_open = is_open && fits(own, before);
        if (is_open && own > 0u) {
            uint found = rank_of(gain, before, before + own);
#if LOW
            if (found >> uint(HALF_BITS) == high) atomicAdd(own_counted[found & (SIZE - 1u)], own);
#else
            atomicAdd(own_counted[found >> uint(HALF_BITS)], own);
#endif
        }
        before += own;
    }
}

void main() {
    if (complete == 1u) return;
    uint lane = gl_LocalInvocationIndex;
    for (uint i = lane; i < SIZE; i += 256u) own_counted[i] = 0u;
    barrier();
    for (uint i = 0u; i < uint(BLOCK) / 256u; ++i) {
        uint p = gl_WorkGroupID.x * uint(BLOCK) + i * 256u + lane;
        if (p < pixels) add_events(p);
    }
    barrier();
    for (uint i = lane; i < SIZE; i += 256u)
        if (own_counted[i] > 0u) atomicAdd(counted[i], own_counted[i]);
}
