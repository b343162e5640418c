#version 450
// Fragments of a pixel's first bins are appended to its core, the others go to the tail.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
uniform int width;
#include "kbuffer/tail.glsl"

#include "common/pool.glsl"

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
    uint p = uint(xy.y * width + xy.x);
    float place = bin_place(v_depth, range_of(xy, width));
    if (uint(bin_of(place)) < bin_word[core_at(p)] >> CURSOR_BITS) {
        put_slot(atomicAdd(bin_word[core_at(p)], 1u) & CURSOR_MASK, uvec2(pack(stored), floatBitsToUint(v_depth)));
        skip_tail();
        return;
    }
    accumulate_tail(int(p), stored, v_depth);
}
