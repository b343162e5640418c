#version 450
// What the geometry pass found: from the front for blending behind what the picture has, from the back composited over
// the background. Sets up the next pass.
#include "common/composite.glsl"
#include "depth-peeling/side.glsl"

layout(std430, binding = 2) buffer Back { float back[]; };  // RGB of each pixel
layout(std430, binding = 3) buffer Left { uint is_left; };
layout(binding = 0) uniform sampler2D background;
uniform int width;
uniform int first_row;
uniform bool is_first;  // of the steps: the background is there before all
layout(location = 0) out vec4 out_light;  // premultiplied RGB, transmittance

void write(int p, vec3 light) {
    for (int i = 0; i < 3; ++i) back[3 * p + i] = light[i];
}

void main() {
    if (gl_HelperInvocation) return;
    ivec2 xy = ivec2(gl_FragCoord.xy);
    int p = (xy.y - first_row) * width + xy.x;
    vec3 root = texelFetch(background, xy, 0).rgb;
    if (is_first) write(p, root * root);
    Side near = side[2 * p], far = side[2 * p + 1];
    if (near.depth == OVER && far.depth == OVER) discard;
    uint nears = count[2 * p], fars = count[2 * p + 1];
    vec4 front = vec4(0.0, 0.0, 0.0, 1.0);
    vec4 behind = vec4(is_first ? root * root : vec3(back[3 * p], back[3 * p + 1], back[3 * p + 2]), 1.0);
    for (uint repeat = repeats(near, nears); repeat > 0u; --repeat) add_behind(near.taken, front);
    for (uint repeat = repeats(far, fars); repeat > 0u; --repeat) add_in_front(~far.taken, behind);
    if (is_last(nears)) add_behind(near.next_colour, front);
    if (is_last(fars)) add_in_front(~far.next_colour, behind);
    out_light = front;
    write(p, behind.rgb);
    bool more_near = near.depth != OVER && advance(2 * p), more_far = far.depth != OVER && advance(2 * p + 1);
    if (more_near || more_far) is_left = 1u;
}
