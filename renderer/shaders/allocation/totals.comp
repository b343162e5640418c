#version 450
// Fragments that can be in a core, and occupied pixels.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"
#include "allocation/bins.glsl"

uniform uint pixels;
shared uint found, filled;

void main() {
    uint lane = gl_LocalInvocationIndex;
    if (lane == 0u) found = filled = 0u;
    barrier();
    uint sum = 0u, some = 0u;
    for (uint i = 0u; i < uint(BLOCK) / 256u; ++i) {
        uint p = gl_WorkGroupID.x * uint(BLOCK) + i * 256u + lane;
        if (p >= pixels) continue;
        PixelBins bins = bins_of(p);
        some += uint(known_fragments(bins) > 0u);
        uint before = 0u;
        bool is_open = true;
        for (int bin = 0; bin < BINS; ++bin) {
            uint own = of_bin(bins, bin);
            is_open = is_open && fits(own, before);
            before += is_open ? own : 0u;
        }
        sum += before;
    }
    atomicAdd(found, sum);
    atomicAdd(filled, some);
    barrier();
    if (lane == 0u) {
        atomicAdd(fragments, found);
        atomicAdd(occupied, filled);
    }
}
