#version 450
// The peeled layers over the background.
#include "common/composite.glsl"

layout(std430, binding = 1) readonly buffer Light { vec4 light[]; };  // premultiplied RGB, transmittance
layout(binding = 0) uniform sampler2D background;
uniform int width;
uniform int first_row;
layout(location = 0) out vec4 out_colour;

void main() {
    ivec2 xy = ivec2(gl_FragCoord.xy);
    out_colour = vec4(over(light[(xy.y - first_row) * width + xy.x], texelFetch(background, xy, 0).rgb), 1.0);
}
