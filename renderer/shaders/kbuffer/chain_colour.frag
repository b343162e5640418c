#version 450
// Second pass of the chain: every fragment finds its slot by its depth, or goes to the tail.
// Fragments of equal depth share a run of slots; a chain over the packed colour orders them as the sorted dump does.
// TAIL -1: every fragment has a slot.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
uniform int width;
#if TAIL >= 0
#include "kbuffer/tail.glsl"
#else
void skip_tail() {}
#endif

layout(std430, binding = 0) readonly buffer Offsets { uint offset[]; };  // [P+1]
layout(std430, binding = 1) readonly buffer Depths { uint depth[]; };
layout(std430, binding = 2) coherent buffer Colours { uint colour[]; };

const uint EMPTY = 0xFFFFFFFFu;

uint first_slot_not_nearer(uint begin, uint end, uint z) {
    while (begin < end) {
        uint middle = (begin + end) >> 1;
        if (depth[middle] < z) begin = middle + 1u; else end = middle;
    }
    return begin;
}

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) {
        skip_tail();
        return;
    }
#endif
    if (gl_HelperInvocation) return;  // beyond the window's edge there are no offsets, and loops would go anywhere
    int p = int(gl_FragCoord.y) * width + int(gl_FragCoord.x);
    uint end = offset[p + 1];
    uint z = floatBitsToUint(v_depth);
    uint word = pack(stored);
    for (uint i = first_slot_not_nearer(offset[p], end, z); i < end && depth[i] == z; ++i) {
        uint before = atomicMin(colour[i], word);
        if (before == EMPTY) {  // it found a free slot: nothing is left for the tail
            skip_tail();
            return;
        }
        word = max(word, before);
    }
#if TAIL >= 0
    accumulate_tail(p, unpack(word), v_depth);
#endif
}
