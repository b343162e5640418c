#version 450
// What the geometry pass found, for blending behind what the picture has; sets up the next pass.
#include "common/composite.glsl"
#include "depth-peeling/side.glsl"

uniform int width;
uniform int first_row;
layout(location = 0) out vec4 out_light;  // premultiplied RGB, transmittance

void main() {
    if (gl_HelperInvocation) return;
    int p = (int(gl_FragCoord.y) - first_row) * width + int(gl_FragCoord.x);
    Side front = side[p];
    if (front.depth == OVER) discard;
    uint counts = count[p];
    vec4 light = vec4(0.0, 0.0, 0.0, 1.0);
    for (uint repeat = repeats(front, counts); repeat > 0u; --repeat) add_behind(front.taken, light);
    if (is_last(counts)) add_behind(front.next_colour, light);
    out_light = light;
    advance(p);
}
