#version 450
// Fragments by the rank of the price that they come at.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"
#include "allocation/bins.glsl"

uniform uint pixels;
shared uint own_counted[RANKS];

void add_event(inout uint before, inout bool is_open, uint own, uint found) {
    is_open = is_open && fits(own, before);
    if (is_open && own > 0u) atomicAdd(own_counted[found], own);
    before += own;
}

void add_events(uint p) {
    PixelBins bins = bins_of(p);
    PixelBins ranks = ranks_of(p);
    uint before = 0u;
    bool is_open = true;
#define EVENT(bin) add_event(before, is_open, of_bin(bins, bin), of_bin(ranks, bin));
    EACH_BIN(EVENT)
}

void main() {
    if (complete == 1u) return;
    uint lane = gl_LocalInvocationIndex;
    for (uint i = lane; i < uint(RANKS); i += 256u) own_counted[i] = 0u;
    barrier();
    for (uint i = 0u; i < uint(BLOCK) / 256u; ++i) {
        uint p = gl_WorkGroupID.x * uint(BLOCK) + i * 256u + lane;
        if (p < pixels) add_events(p);
    }
    barrier();
    for (uint i = lane; i < uint(RANKS); i += 256u)
        if (own_counted[i] > 0u) atomicAdd(counted[i], own_counted[i]);
}
