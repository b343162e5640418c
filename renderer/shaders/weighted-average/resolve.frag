#version 450
// n surfaces of the mean colour and the mean opacity. Linear RGB out.
#include "common/log1p.glsl"

layout(binding = 0) uniform sampler2D background;  // gamma-2 encoded
layout(binding = 1) uniform sampler2D colours;     // sum a C, sum a
layout(binding = 2) uniform sampler2D counts;      // n
layout(location = 0) out vec4 out_colour;

void main() {
    ivec2 xy = ivec2(gl_FragCoord.xy);
    vec3 colour = texelFetch(background, xy, 0).rgb;
    colour *= colour;
    float n = texelFetch(counts, xy, 0).r;
    if (n > 0.0) {
        vec4 sum = texelFetch(colours, xy, 0);
        float through = exp(n * log1p(-sum.a / n));  // (1 - mean a)^n
        colour = (1.0 - through) * (sum.rgb / sum.a) + through * colour;
    }
    out_colour = vec4(colour, 1.0);
}
