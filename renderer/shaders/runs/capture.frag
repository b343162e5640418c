#version 450
// Every transparent fragment into its pixel's run of the pool, in any order: the sort comes after.
// WORDS == 3: with its place in the order of submission; drawn with `ranked`.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 0) buffer Cursor { uint cursor[]; };        // of the window's pixels
#if WORDS == 2
layout(std430, binding = 1) writeonly buffer Pool { uvec2 words[]; };  // as runs.glsl has it
#else
layout(std430, binding = 1) writeonly buffer Pool { uint word[]; };
#endif
uniform int width;
uniform uint base;  // fragments before this pool
#if WORDS == 3
uniform int first_triangle;
#endif

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) return;
#endif
    int p = int(gl_FragCoord.y) * width + int(gl_FragCoord.x);
    uint at = atomicAdd(cursor[p], 1u) - base;
#if WORDS == 2
    words[at] = uvec2(pack(stored), floatBitsToUint(v_depth));
#else
    word[3u * at] = pack(stored);
    word[3u * at + 1u] = floatBitsToUint(v_depth);
    word[3u * at + 2u] = uint(first_triangle + gl_PrimitiveID);
#endif
}
