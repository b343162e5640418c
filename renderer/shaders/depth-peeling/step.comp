#version 450
// Composites what the geometry pass found, and sets up the next one.
layout(local_size_x = 64) in;
#include "common/composite.glsl"
#include "depth-peeling/side.glsl"

layout(std430, binding = 0) buffer Sides { Side side[]; };
layout(std430, binding = 1) buffer Light { vec4 light[]; };  // premultiplied RGB, transmittance
layout(std430, binding = 2) readonly buffer Pixels { uint pixel[]; };
layout(std430, binding = 3) buffer Active { uint active_pixels; };
uniform int pixels;
uniform int first;

void main() {
    int i = int(gl_GlobalInvocationID.x) + first;
    if (i >= pixels) return;
    uint p = pixel[i];
    Side front = side[p];
    if (front.depth == OVER) return;
    vec4 sum = light[p];
    for (uint repeat = repeats(front); repeat > 0u; --repeat) add_behind(front.taken, sum);
    if (is_last(front)) add_behind(front.next_colour, sum);
    light[p] = sum;
    front = has_more(front) ? behind_found(front) : fresh(front.next_depth);
    side[p] = front;
    if (front.depth != OVER) atomicAdd(active_pixels, 1u);
}
