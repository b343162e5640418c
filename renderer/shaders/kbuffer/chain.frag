#version 450
// The chain in one pass, with 64-bit atomics: keys are depth, then packed colour, the order of the sorted dump.
// Each slot keeps the minimum of what passes it and hands the larger key on; what falls out of the last one goes to the
// tail at once. TAIL -1: every fragment has a slot.
#extension GL_ARB_gpu_shader_int64 : require
#extension GL_NV_shader_atomic_int64 : require
layout(early_fragment_tests) in;
#include "common/surface.glsl"
uniform int width;
#if TAIL >= 0
#include "kbuffer/tail.glsl"
#else
void skip_tail() {}
#endif

layout(std430, binding = 0) readonly buffer Offsets { uint offset[]; };  // [P+1]
layout(std430, binding = 2) coherent buffer Slots { uint64_t slot[]; };

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) {
        skip_tail();
        return;
    }
#endif
    if (gl_HelperInvocation) return;  // beyond the window's edge there are no offsets, and loops would go anywhere
    const uint64_t empty = packUint2x32(uvec2(0xFFFFFFFFu));
    int p = int(gl_FragCoord.y) * width + int(gl_FragCoord.x);
    uint end = offset[p + 1];
    uint64_t key = packUint2x32(uvec2(pack(stored), floatBitsToUint(v_depth)));
    for (uint i = offset[p]; i < end; ++i) {
        // A slot only ever falls, so one whose depth is below ours here stays so: the atomic would change nothing. Only
        // half of it is compared, since a plain read of 64 bits may see halves of two keys.
        if (unpackUint2x32(slot[i]).y < unpackUint2x32(key).y) continue;
        uint64_t before = atomicMin(slot[i], key);
        if (before == empty) {  // it found a free slot: nothing is left for the tail
            skip_tail();
            return;
        }
        key = max(key, before);
    }
#if TAIL >= 0
    uvec2 fallen = unpackUint2x32(key);
    accumulate_tail(p, unpack(fallen.x), uintBitsToFloat(fallen.y));
#endif
}
