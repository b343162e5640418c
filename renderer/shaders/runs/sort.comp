#version 450
// Sorts the runs of a band that are shorter than LONG, in place, by Shell's method with Knuth's gaps: for 256 fragments
// that is at most 33,000 turns, far below where drivers end loops.
layout(local_size_x = 64) in;
#include "runs/runs.glsl"

uniform uint first_pixel;
uniform uint pixels;  // of the band

void main() {
    uint at = gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * gl_NumWorkGroups.x * 64u;
    if (at >= pixels) return;
    uvec2 run = run_of(first_pixel + at);
    uint n = run.y - run.x;
    if (n < 2u || n >= uint(LONG)) return;
    uint gap = 1u;
    while (3u * gap + 1u < n) gap = 3u * gap + 1u;
    for (; gap > 0u; gap /= 3u) {
        for (uint i = run.x + gap; i < run.y; ++i) {
            Fragment moved = fragment_at(i);
            uint j = i;
            for (; j >= run.x + gap; j -= gap) {
                Fragment other = fragment_at(j - gap);
                if (!is_before(moved, other)) break;
                put(j, other);
            }
            if (j < i) put(j, moved);
        }
    }
}
