#version 450
// What was peeled from the front over what was peeled from the back, over the background.
#include "common/composite.glsl"

layout(std430, binding = 1) readonly buffer Light { vec4 light[]; };  // front and back: premultiplied RGB, transmittance
layout(binding = 0) uniform sampler2D background;
uniform int width;
uniform int first_row;
layout(location = 0) out vec4 out_colour;

void main() {
    ivec2 xy = ivec2(gl_FragCoord.xy);
    int p = (xy.y - first_row) * width + xy.x;
    vec4 front = light[2 * p], back = light[2 * p + 1];
    out_colour = vec4(front.rgb + front.a * over(back, texelFetch(background, xy, 0).rgb), 1.0);
}
