#version 450
// The colour of all fragments as one weighted mean, with their exact total transmittance. Linear RGB out.
// DEPTH_UNIT: optical depths are stored divided by it.
layout(binding = 0) uniform sampler2D background;  // gamma-2 encoded
layout(binding = 1) uniform sampler2D sums;        // sum w C, sum w
layout(binding = 2) uniform sampler2D depths;      // optical depth, sum -ln(1-a)
layout(location = 0) out vec4 out_colour;

void main() {
    ivec2 xy = ivec2(gl_FragCoord.xy);
    vec3 colour = texelFetch(background, xy, 0).rgb;
    colour *= colour;
    vec4 sum = texelFetch(sums, xy, 0);
    if (sum.a > 0.0) {
        float through = exp(-DEPTH_UNIT * texelFetch(depths, xy, 0).r);
        colour = (1.0 - through) * (sum.rgb / sum.a) + through * colour;
    }
    out_colour = vec4(colour, 1.0);
}
