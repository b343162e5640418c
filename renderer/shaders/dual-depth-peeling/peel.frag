#version 450
// One geometry pass of dual peeling: colours at both depths that are being taken, and the next depths between them.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "depth-peeling/side.glsl"

uniform int width;
uniform int first_row;

void collect(int at, uint colour) {
    if (colour <= side[at].taken) return;
    atomicMin(side[at].next_colour, colour);
    atomicAdd(count[at], 1u);
}

void main() {
    int front = 2 * ((int(gl_FragCoord.y) - first_row) * width + int(gl_FragCoord.x)), back = front + 1;
    uint z = floatBitsToUint(v_depth);
    bool behind_front = z > side[front].depth, before_back = ~z > side[back].depth;
    bool at_front = z == side[front].depth, at_back = ~z == side[back].depth;
    if (!(behind_front && before_back || at_front || at_back)) return;  // taken before
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) return;
#endif
    uint word = pack(stored);
    if (at_front) {  // also where the sides have met: the back finds nothing there and ends
        collect(front, word);
    } else if (at_back) {
        collect(back, ~word);
    } else {
        atomicMin(side[front].next_depth, z);
        atomicMin(side[back].next_depth, ~z);
    }
}
