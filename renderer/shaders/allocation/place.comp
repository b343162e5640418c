#version 450
// Where each pixel's core lies in the pool. What is left of the budget goes to the pixels that grow at the chosen rank,
// by index; the first that does not fit takes what does.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"
#include "allocation/bins.glsl"
#include "allocation/cut.glsl"

layout(std430, binding = 3) readonly buffer Blocks { uvec2 sums[]; };  // [blocks], before each
uniform uint pixels;
const uint OWN = uint(BLOCK) / 256u;
shared uvec2 part[256];

Cut stored_cut(uint p) {
    return p < pixels ? unpacked_cut(bin_word[cut_at(p)]) : Cut(0u, 0u, 0u, 0u);
}

// Bins of a pixel that may grow by so many fragments and no more.
uint bins_within(uint p, Cut cut, uint room) {
    PixelBins counts = bins_of(p);
    uint bins = cut.bins, taken = 0u;
    for (uint bin = cut.bins; bin < cut.more_bins; ++bin) {
        uint own = of_bin(counts, int(bin));
        taken += own;
        if (taken > room) break;
        if (own > 0u) bins = bin + 1u;
    }
    return bins;
}

void main() {
    uint lane = gl_LocalInvocationIndex, block = gl_WorkGroupID.x;
    uint first = block * uint(BLOCK) + lane * OWN;
    uvec2 own = uvec2(0u);
    for (uint i = 0u; i < OWN; ++i) {
        Cut cut = stored_cut(first + i);
        own += uvec2(cut.fragments, cut.more_fragments - cut.fragments);
    }
    part[lane] = own;
    for (uint reach = 1u; reach < 256u; reach *= 2u) {
        barrier();
        uvec2 other = lane >= reach ? part[lane - reach] : uvec2(0u);
        barrier();
        part[lane] += other;
    }
    uvec2 before = sums[block] + part[lane] - own;
    uint spare = complete == 1u ? 0u : budget - spent;
    for (uint i = 0u; i < OWN; ++i) {
        uint p = first + i;
        if (p >= pixels) return;
        Cut cut = stored_cut(p);
        uint growth = cut.more_fragments - cut.fragments;
        uint begin = before.x + min(before.y, spare), bins = cut.bins;
        if (before.y + growth <= spare) bins = cut.more_bins;
        else if (before.y < spare) bins = bins_within(p, cut, spare - before.y);
        bin_word[begin_at(p)] = begin;
        bin_word[core_at(p)] = bins << CURSOR_BITS | begin;
        before += uvec2(cut.fragments, growth);
    }
}
