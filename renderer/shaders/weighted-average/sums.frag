#version 450
// What the plain average needs, by additive blending.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(location = 0) out vec4 colours;  // sum a C, sum a
layout(location = 1) out float count;   // n

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) discard;
#endif
    float a = float(stored.a) / 255.0;
    vec3 root = vec3(stored.rgb) / 255.0;
    colours = vec4(a * root * root, a);
    count = 1.0;
}
