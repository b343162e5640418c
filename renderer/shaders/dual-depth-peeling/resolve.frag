#version 450
// What was peeled from the back over the background, for blending behind what was peeled from the front.
layout(std430, binding = 2) readonly buffer Back { float back[]; };  // RGB of each pixel
uniform int width;
uniform int first_row;
layout(location = 0) out vec4 out_colour;

void main() {
    if (gl_HelperInvocation) return;
    int p = (int(gl_FragCoord.y) - first_row) * width + int(gl_FragCoord.x);
    out_colour = vec4(back[3 * p], back[3 * p + 1], back[3 * p + 2], 1.0);
}
