#version 450
// Composites what the geometry pass found on both sides, and sets up the next one.
layout(local_size_x = 64) in;
#include "common/composite.glsl"
#include "depth-peeling/side.glsl"

layout(std430, binding = 0) buffer Sides { Side side[]; };   // front and back of each pixel
layout(std430, binding = 1) buffer Light { vec4 light[]; };  // the same; premultiplied RGB, transmittance
layout(std430, binding = 2) readonly buffer Pixels { uint pixel[]; };
layout(std430, binding = 3) buffer Active { uint active_pixels; };
uniform int pixels;
uniform int first;

void main() {
    int i = int(gl_GlobalInvocationID.x) + first;
    if (i >= pixels) return;
    uint at = 2u * pixel[i];
    Side front = side[at], back = side[at + 1u];
    if (front.depth == OVER && back.depth == OVER) return;
    vec4 near = light[at], far = light[at + 1u];
    for (uint repeat = repeats(front); repeat > 0u; --repeat) add_behind(front.taken, near);
    for (uint repeat = repeats(back); repeat > 0u; --repeat) add_in_front(~back.taken, far);
    if (is_last(front)) add_behind(front.next_colour, near);
    if (is_last(back)) add_in_front(~back.next_colour, far);
    light[at] = near;
    light[at + 1u] = far;
    front = has_more(front) ? behind_found(front) : fresh(front.next_depth);
    back = has_more(back) ? behind_found(back) : fresh(back.next_depth);
    side[at] = front;
    side[at + 1u] = back;
    if (front.depth != OVER || back.depth != OVER) atomicAdd(active_pixels, 1u);
}
