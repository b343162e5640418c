#version 450
// What lies behind, where nothing is transparent.
layout(binding = 0) uniform sampler2D background;  // gamma-2 encoded
layout(location = 0) out vec4 out_colour;

void main() {
    vec3 root = texelFetch(background, ivec2(gl_FragCoord.xy), 0).rgb;
    out_colour = vec4(root * root, 1.0);
}
