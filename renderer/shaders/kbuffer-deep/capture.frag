#version 450
// Fragments of a pixel's first bins are appended to its core, the others go to the tail. Cuts and cursors are the first
// two of the words that counted the bins (allocation/place.comp).
layout(early_fragment_tests) in;
#include "common/surface.glsl"
uniform int width;
#include "kbuffer/tail.glsl"

layout(std430, binding = 1) buffer Counts { uint counts[]; };             // [P, BINS / 4]: cut, cursor
layout(std430, binding = 2) writeonly buffer Pool { uvec2 fragments[]; };  // packed colour, depth bits

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) {
        skip_tail();
        return;
    }
#endif
    if (gl_HelperInvocation) return;
    ivec2 xy = ivec2(gl_FragCoord.xy);
    int p = xy.y * width + xy.x, at = p * (BINS / 4);
    if (uint(bin_of(bin_place(v_depth, range_of(xy, width)))) < counts[at]) {
        fragments[atomicAdd(counts[at + 1], 1u)] = uvec2(pack(stored), floatBitsToUint(v_depth));
        skip_tail();
        return;
    }
    accumulate_tail(p, stored, v_depth);
}
