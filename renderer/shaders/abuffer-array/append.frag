#version 450
// Every transparent fragment into the next slot of its pixel's array.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 0) buffer Used { uint used[]; };  // of the window
layout(std430, binding = 1) writeonly buffer Slots { uvec2 slot[]; };  // packed colour, depth bits
uniform int width;
uniform int first_row;
uniform int slots;  // of every pixel

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) return;
#endif
    int p = int(gl_FragCoord.y) * width + int(gl_FragCoord.x);
    slot[uint(p - first_row * width) * uint(slots) + atomicAdd(used[p], 1u)] = uvec2(pack(stored), floatBitsToUint(v_depth));
}
