#version 450
// One geometry pass of peeling: colours at the depth that is being taken, and the next depth behind it.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "depth-peeling/side.glsl"

uniform int width;
uniform int first_row;

void main() {
    int p = (int(gl_FragCoord.y) - first_row) * width + int(gl_FragCoord.x);
    uint z = floatBitsToUint(v_depth);
    uint depth = side[p].depth;
    if (z < depth) return;  // taken before
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) return;
#endif
    uint word = pack(stored);
    if (z > depth) {
        atomicMin(side[p].next_depth, z);
    } else if (word > side[p].taken) {
        atomicMin(side[p].next_colour, word);
        atomicAdd(count[p], 1u);
    }
}
