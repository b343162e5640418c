#version 450
// Every transparent fragment into its pixel's run of the pool, in any order: the sort comes after.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 0) buffer Cursor { uint cursor[]; };
layout(std430, binding = 1) writeonly buffer Pool { uvec2 fragments[]; };  // packed colour, depth bits: a little-endian 64-bit sort key
uniform int width;
uniform int first_row;

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) return;
#endif
    int p = (int(gl_FragCoord.y) - first_row) * width + int(gl_FragCoord.x);
    fragments[atomicAdd(cursor[p], 1u)] = uvec2(pack(stored), floatBitsToUint(v_depth));
}
