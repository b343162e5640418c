#version 450
// Every fragment into the tail's sums, weighed by what the depth bins know to be in front of it.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
uniform int width;
#include "kbuffer/tail.glsl"

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) {
        skip_tail();
        return;
    }
#endif
    int p = int(gl_FragCoord.y) * width + int(gl_FragCoord.x);
    accumulate_tail(p, stored, v_depth);
}
