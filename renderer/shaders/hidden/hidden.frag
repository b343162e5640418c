#version 450
// Writes nothing: an occlusion query counts what the depth test and the cut-outs leave.
#include "common/surface.glsl"

void main() {
#if MIXED
    if (!is_transparent(stored_surface())) discard;
#endif
}
